"""Strandline: surface models and volumes of low-contrast coasts from drone photographs, in QGIS."""


def classFactory(iface: object) -> object:  # noqa: N802 - QGIS asks for this name
    """Return the plugin; QGIS calls this."""
    from .provider.plugin import StrandlinePlugin

    return StrandlinePlugin(iface)

"""The QGIS face of Strandline: plugin, provider, options."""

"""The dense surface: correlation in ground geometry, regularisation, DSM and orthophoto."""

"""VDA 5050: one version-neutral model with the content and names of 3.0.0, and a codec per version.

Everything in NeNa works on the neutral messages; a version's own names, enumerations and units of time exist
only in the package of that version. Section numbers in this package are those of VDA 5050 3.0.0 unless it
says otherwise.
"""

"""Black box: the last minutes of a program in memory, as an MCAP file, and on its way to the server."""

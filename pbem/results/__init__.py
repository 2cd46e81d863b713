"""The result file and what is made of it: HDF5 writer and reader, summaries, plots."""

"""The result file, written and read with HDF5, and everything derived from it: summaries, tables, exports, pictures.

Pictures: `plots.py` (bodies and interfaces, drawn by `body_plot.py` and `curve_plot.py`), `field_plot.py`,
`trace_plot.py` (crack networks), `model_plot.py`. Export to ParaView: `vtkhdf.py`.
"""

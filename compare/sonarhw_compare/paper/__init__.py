"""The paper's figures, drawn by the model, and what the paper says of each held against it.

One file an experiment (`plates`, `laboratory`, `beam`, `single_reflections`, `simple_room`, `corners`, `rays`,
`corridor`) hands on its exhibits; `page` lists them all in the order of the paper.
"""

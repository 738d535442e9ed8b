"""The paper's figures, drawn by the model and checked against the text of the paper.

There is one module for each experiment; `page` lists all exhibits in the order of the paper.
"""

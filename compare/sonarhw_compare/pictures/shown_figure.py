"""Matplotlib figures that a Jupyter notebook shows without pyplot and without `%matplotlib inline`."""

from io import BytesIO

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


class ShownFigure(Figure):
    """A figure with its own canvas. Jupyter shows other figures only after pyplot has been used."""

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png", dpi=self.dpi)
        return file.getvalue()


def new_figure(width: float, height: float, dpi: int) -> Figure:
    """Return an empty figure of this size, inches, with `dpi` pixels an inch."""
    figure = ShownFigure(figsize=(width, height), dpi=dpi, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def laid_out(figure: Figure) -> Figure:
    """Return the figure after a first layout.

    The layout reserves space for the tick labels that axes of equal scale have before they are resized. In a second
    layout, at drawing, these are the final ones.
    """
    figure.draw_without_rendering()
    return figure

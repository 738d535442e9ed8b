"""The page of figures: a picture of every exhibit, and the text of `figures.md`, in the order of the paper."""

from textwrap import fill

from sonarhw_compare.paper import beam_figures as beam
from sonarhw_compare.paper import corner_figures as corners
from sonarhw_compare.paper import corridor_figures as corridor
from sonarhw_compare.paper import laboratory_figures as laboratory
from sonarhw_compare.paper import plate_figures as plates
from sonarhw_compare.paper import ray_figures as rays
from sonarhw_compare.paper import simple_room_figures as simple_room
from sonarhw_compare.paper import single_reflection_figures as single_reflections
from sonarhw_compare.paper.exhibit import Claim, Exhibit
from sonarhw_compare.pictures.picture_file import picture_bytes

PAGE = "figures.md"
EXHIBITS: tuple[Exhibit, ...] = (
    *plates.EXHIBITS,
    *laboratory.EXHIBITS,
    *beam.EXHIBITS,
    *single_reflections.EXHIBITS,
    *simple_room.EXHIBITS,
    *corners.EXHIBITS,
    *rays.EXHIBITS,
    *corridor.EXHIBITS,
)
_HEAD = """\
# The paper's figures

Every figure of Dudek, Jenkin, Milios, Wilkes, *Reflections on modelling a sonar range sensor* (CIM-92-9), drawn
again by the model. Each table lists what the paper says, what the model shows, and whether they agree.
`sonarhw figures DIR` writes this page and its pictures; the tests check every line. The commands of each figure
predict the same scans. The paper's own pictures are not included, and no readings were taken from them: only its text
and its dimensions are compared. A value that is *ours* was chosen here, because the paper does not state it. Plans are
cropped where they would show only distant readings.
"""


def picture_name(exhibit: Exhibit, suffix: str) -> str:
    """Return the file name of an exhibit's picture."""
    return f"{exhibit.name}{suffix}"


def picture(exhibit: Exhibit, suffix: str = ".png") -> bytes:
    """Return the picture of an exhibit in the format of `suffix`."""
    return picture_bytes(exhibit.draw(), suffix, tight=True)


def claims(exhibit: Exhibit) -> tuple[Claim, ...]:
    """Return the paper's claims about an exhibit, checked against the model."""
    return tuple(claim() for claim in exhibit.claims)


def page(suffix: str = ".png") -> str:
    """Return the text of the page, Markdown, with pictures of this format."""
    return "\n".join((_HEAD, *(_section(exhibit, suffix) for exhibit in EXHIBITS)))


def _section(exhibit: Exhibit, suffix: str) -> str:
    lines = [f"## {exhibit.title}", "", fill(exhibit.setting, 118), ""]
    if exhibit.scenes:
        lines += ["```", *(scene.command for scene in exhibit.scenes), "```", ""]
    lines += [f"![{exhibit.title}]({picture_name(exhibit, suffix)})", ""]
    lines += ["| the paper says | the model shows | agrees |", "|---|---|---|"]
    lines += [_row(claim) for claim in claims(exhibit)]
    return "\n".join((*lines, ""))


def _row(claim: Claim) -> str:
    return f"| {claim.says} | {claim.measured} | {'yes' if claim.holds else '**no**'} |"

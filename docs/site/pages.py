"""Pages of the site from outside docs/: README, protocol, porting, CONTRIBUTING, CHANGELOG, commands; Python by task.

MkDocs runs this file as a hook (see mkdocs.yml). Links to these files are changed to links to their pages.
"""

import re
from pathlib import Path

import typer
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from sonarhw_cli.app import app
from typer.cli import get_docs_for_click

import sonarhw

ROOT = Path(__file__).parents[2]
PAGES = {
    "README.md": "index.md",
    "firmware_protocol.md": "firmware_protocol.md",
    "firmware/PORTING.md": "porting.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
# pages that are part of another page now; browsers that ask for their old addresses go there
MOVED = {
    "how_to/plan.html": "window.html#the-plan-key-1",
    "how_to/trace.html": "window.html#traces",
    "how_to/window_searches.html": "window.html#fit-f9",
    "explanation/room_search.html": "fit_method.html#the-search-for-a-room",
}
_IN_DOCS = re.compile(r"\]\((?:\.\./)?docs/")
# links to files that are not pages of the site; only their text is kept
_NO_PAGE = re.compile(r"\[([^\]]+)\]\((?:\.\./)?[^)#:]*(?:firmware|\.ipynb|\.py|LICENSE|rooms/?)\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Return the files of the site with the pages from outside docs/."""
    for source, page in PAGES.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=_IN_DOCS.sub("](", text)))
    files.append(File.generated(config, "reference/commands.md", content=_commands()))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return the text of a page with links to pages of the site; the page of `sonarhw` in the order of its tasks."""
    if page.file.src_uri == "reference/sonarhw.md":
        markdown = _by_task()
    for source, target in PAGES.items():
        markdown = re.sub(rf"\]\((?:\.\./)*{re.escape(source)}", f"]({_up(page)}{target}", markdown)
    return _NO_PAGE.sub(r"\1", markdown)


def on_post_build(config: MkDocsConfig) -> None:
    """Write the pages that lead from old addresses to new ones."""
    for old, new in MOVED.items():
        text = f'<!doctype html><meta http-equiv="refresh" content="0; url={new}"><a href="{new}">{new}</a>\n'
        (Path(config.site_dir) / old).write_text(text, encoding="utf-8")


def _up(page: Page) -> str:
    return "../" * page.file.src_uri.count("/")


def _by_task() -> str:
    """Return the reference of `sonarhw`: each task of its docstring is a heading, followed by the names it lists."""
    introduction, *tasks = re.split(r"^(\w[\w ]+)\n\n(?=- )", str(sonarhw.__doc__), flags=re.MULTILINE)
    parts, remaining = [f"# sonarhw\n\n{introduction}"], set(sonarhw.__all__)
    for title, text in zip(tasks[::2], tasks[1::2], strict=True):
        names = [name for name in dict.fromkeys(re.findall(r"`(\w+)`", text)) if name in remaining]
        remaining -= {*names}
        parts += [
            f"## {title}\n\n{text}",
            *(f"::: sonarhw.{name}\n    options: {{heading_level: 3}}\n" for name in names),
        ]
    return "\n".join(parts)


def _commands() -> str:
    command = typer.main.get_command(app)
    text = get_docs_for_click(obj=command, ctx=typer.Context(command), name="sonarhw", title="Commands")
    return re.sub(r"^(#+) `(.*)`$", r"\1 \2", text, flags=re.MULTILINE)

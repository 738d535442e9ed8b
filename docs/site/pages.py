"""Pages of the site from outside docs/: README, protocol, porting, CONTRIBUTING, CHANGELOG; commands, Python by task.

MkDocs runs this file as a hook (see mkdocs.yml). Links to these files are changed to links to their pages.
"""

import logging
import re
from pathlib import Path
from typing import cast

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
LONGEST = 3500  # words of a page; the protocol is one document
_LOG = logging.getLogger("mkdocs.hooks.pages")
_IN_DOCS = re.compile(r"\]\((?:\.\./)?docs/")
# links to files that are not pages of the site; only their text is kept
_NO_PAGE = re.compile(r"\[([^\]]+)\]\((?:\.\./)?[^)#:]*(?:firmware|\.ipynb|\.py|LICENSE|rooms/?)\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Return the files of the site with the pages from outside docs/."""
    for source, page in PAGES.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=_IN_DOCS.sub("](", text)))
    generated = _commands() | _tasks()
    index = files.get_file_from_path("reference/sonarhw.md")
    assert index is not None
    files.remove(index)  # the file is there for links in docs/
    for address, text in generated.items():
        files.append(File.generated(config, address, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return the text of a page with links to pages of the site."""
    for source, target in PAGES.items():
        markdown = re.sub(rf"\]\((?:\.\./)*{re.escape(source)}", f"]({_up(page)}{target}", markdown)
    return _NO_PAGE.sub(r"\1", markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> None:
    """Warn of a page that is too long to read, which fails the build."""
    words = len(re.sub(r"<[^>]*>", "", html).split())
    if words > LONGEST and page.file.src_uri != "firmware_protocol.md":
        _LOG.warning("%s: %d words; at most %d are allowed. Split or shorten it", page.file.src_uri, words, LONGEST)


def on_post_build(config: MkDocsConfig) -> None:
    """Write the pages that lead from old addresses to new ones."""
    for old, new in MOVED.items():
        text = f'<!doctype html><meta http-equiv="refresh" content="0; url={new}"><a href="{new}">{new}</a>\n'
        (Path(config.site_dir) / old).write_text(text, encoding="utf-8")


def _up(page: Page) -> str:
    return "../" * page.file.src_uri.count("/")


def _tasks() -> dict[str, str]:
    """Return the reference of `sonarhw`: an index, and a page for each task that its docstring lists."""
    introduction, *tasks = re.split(r"^(\w[\w ]+)\n\n(?=- )", str(sonarhw.__doc__), flags=re.MULTILINE)
    index, pages, remaining = f"# sonarhw\n\n{introduction}", {}, set(sonarhw.__all__)
    for title, text in zip(tasks[::2], tasks[1::2], strict=True):
        page = f"sonarhw/{_file_name(title)}"
        names = [name for name in dict.fromkeys(re.findall(r"`(\w+)`", text)) if name in remaining]
        remaining -= {*names}
        pages[f"reference/{page}"] = f"# sonarhw: {title}\n\n[All names of `sonarhw`](../sonarhw.md)\n\n" + "\n".join(
            f"::: sonarhw.{name}\n    options: {{heading_level: 2, show_root_toc_entry: true}}\n" for name in names
        )
        for name in names:
            text = text.replace(f"`{name}`", f"{_anchor(f'sonarhw.{name}')}[`{name}`][sonarhw.{name}]", 1)
        index += f"## [{title}]({page})\n\n{text}"
    return {"reference/sonarhw.md": index, **pages}


def _commands() -> dict[str, str]:
    """Return the help of all commands: an index, and a page for each heading of `sonarhw --help`."""
    group = cast(typer.core.TyperGroup, typer.main.get_command(app))
    context = typer.Context(group)
    index = get_docs_for_click(obj=group, ctx=context, name="sonarhw", title="Commands").partition("**Commands**")[0]
    listed: dict[str, str] = {}  # in the order of the headings of the help; groups of commands are last in `group`
    pages: dict[str, str] = {}
    for name, command in group.commands.items():
        if command.hidden:
            continue
        title = str(getattr(command, "rich_help_panel", ""))
        page = f"commands/{_file_name(title)}"
        text = get_docs_for_click(obj=command, ctx=context, indent=1, call_prefix="sonarhw")
        anchors = [heading.replace(" ", "-") for heading in re.findall(r"^#+ `(.*)`$", text, flags=re.MULTILINE)]
        link = f"[`sonarhw {name}`]({page}#{anchors[0]})"
        listed.setdefault(title, f"\n## [{title}]({page})\n\n")
        listed[title] += f"- {''.join(map(_anchor, anchors))}{link}: {command.get_short_help_str()}\n"
        pages.setdefault(f"reference/{page}", f"# Commands: {title}\n\n[All commands](../commands.md)\n\n")
        pages[f"reference/{page}"] += re.sub(r"^(#+) `(.*)`$", r"\1 \2", text, flags=re.MULTILINE)
    return {"reference/commands.md": index + "".join(listed.values()), **pages}


def _anchor(name: str) -> str:
    """Return the place to which old links lead that name an entry of a page that is an index now."""
    return f'<span id="{name}"></span>'


def _file_name(title: str) -> str:
    return re.sub(r"\W", "_", title.lower()) + ".md"

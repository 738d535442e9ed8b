"""Pages of the documentation site that are written elsewhere: README, protocol, CONTRIBUTING, CHANGELOG, commands.

MkDocs reads this file as a hook (see mkdocs.yml). Files outside docs/ become pages, and links to them are adapted.
"""

import re
from pathlib import Path

import typer
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from sonarhw_cli.app import app
from typer.cli import get_docs_for_click

ROOT = Path(__file__).parents[2]
PAGES = {
    "README.md": "index.md",
    "firmware_protocol.md": "firmware_protocol.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
# no page: the file itself, for the reader of a checkout
_NO_PAGE = re.compile(r"\[([^\]]+)\]\((?:\.\./)?[^)#:]*(?:firmware|\.ipynb|\.py|LICENSE|rooms/?)\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Return the site's files with the pages that are written elsewhere."""
    for source, page in PAGES.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=text.replace("](docs/", "](")))
    files.append(File.generated(config, "reference/commands.md", content=_commands()))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return a page whose links lead to pages of the site."""
    for source, target in PAGES.items():
        markdown = re.sub(rf"\]\((?:\.\./)*{re.escape(source)}", f"]({_up(page)}{target}", markdown)
    return _NO_PAGE.sub(r"\1", markdown)


def _up(page: Page) -> str:
    return "../" * page.file.src_uri.count("/")


def _commands() -> str:
    command = typer.main.get_command(app)
    text = get_docs_for_click(obj=command, ctx=typer.Context(command), name="sonarhw", title="Commands")
    return re.sub(r"^(#+) `(.*)`$", r"\1 \2", text, flags=re.MULTILINE)

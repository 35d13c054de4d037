"""wavesim init, cases, schema and completion: a first case, and what helps to write and type."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import click
from click.shell_completion import get_completion_class

from wavesim.report.terminal import BAD_INPUT, console, stop, unwritable

_SCHEMA = "wavesim.schema.json"
_LONGEST = 2000
_WHERE = {
    "bash": 'eval "$(wavesim completion bash)" in ~/.bashrc',
    "zsh": 'eval "$(wavesim completion zsh)" in ~/.zshrc',
    "fish": "wavesim completion fish | source in ~/.config/fish/config.fish",
}


def _write(path: Path, text: str) -> None:
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        if path.is_dir():
            stop(f"{path}: is a folder; name a file in it, as {path / 'case.toml'}", BAD_INPUT)
        stop(f"{path}: is there already; name another file, or take it away", BAD_INPUT)
    except OSError as error:
        stop(*unwritable(error, path, "name another file"))


@click.command(short_help="Write a commented case to begin with.")
@click.argument("file", type=click.Path(), default="case.toml")
@click.option("--schema", is_flag=True, help=f"Write {_SCHEMA} beside it, for editors.")
def init(file: str, schema: bool) -> None:
    """Write a commented case to begin with: FILE, case.toml by default."""
    from wavesim.material.shown import printable

    path = Path(file)
    template = Path(__file__).parents[1] / "case" / "first_case.toml"
    typed = printable(shlex.quote(str(path)), _LONGEST)
    text = template.read_text(encoding="utf-8").replace("{name}", typed)
    _write(path, (f"#:schema ./{_SCHEMA}\n" if schema else "") + text)
    beside = path.parent / _SCHEMA
    if schema and not beside.exists():
        _write(beside, _schema_text())
    click.echo(f"{typed}: a case to change as you like. Run it: wavesim run {typed}")


def _schema_text() -> str:
    from wavesim.case.json_schema import json_schema

    return json.dumps(json_schema(), indent=1, ensure_ascii=False) + "\n"


@click.command(short_help="JSON schema of a case file, for editors.")
def schema() -> None:
    """Print the JSON schema of a case file, from which editors complete and check.

    Even Better TOML and other editors on taplo take it by a first line in the case such as
    "#:schema ./wavesim.schema.json"; wavesim init --schema writes both.
    """
    click.echo(_schema_text(), nl=False)


@click.command(
    short_help="List the cases that come with wavesim, or run one.",
    context_settings={"ignore_unknown_options": True},
    options_metavar="[--show | OPTIONS OF RUN]",
)
@click.argument("name", required=False)
@click.option("--show", is_flag=True, help="Print the case file in place of running it.")
@click.argument("options", nargs=-1, type=click.UNPROCESSED)
@click.pass_context
def cases(context: click.Context, name: str | None, show: bool, options: tuple[str, ...]) -> None:
    """List the cases that come with wavesim, or run the one of that NAME.

    Every command that takes a case takes such a name too, in place of a file.
    """
    from wavesim.case.shipped import shipped, title

    known = shipped()
    if name is None:
        from rich.table import Table

        table = Table(box=None, show_header=False, pad_edge=False)
        for one, path in known.items():
            table.add_row(one, title(path))
        console().print(table)
        click.echo("\nRun one by its name: wavesim run slab. Print one: wavesim cases slab --show")
        return
    if name not in known:
        stop(f"{name}: is no shipped case; name one of {', '.join(known)}", BAD_INPUT)
    if show:
        click.echo(known[name].read_text(encoding="utf-8"), nl=False)
        return
    assert context.parent is not None
    group = context.parent.command
    assert isinstance(group, click.Group)
    run = group.commands["run"]
    with run.make_context("run", [name, *options], parent=context.parent) as inner:
        run.invoke(inner)


@click.command(
    short_help="What makes a shell complete commands and keys.",
    epilog="\n\n".join(f"{shell}: {where}" for shell, where in _WHERE.items()),
)
@click.argument("shell", type=click.Choice(tuple(_WHERE)))
def completion(shell: str) -> None:
    """Print what makes a SHELL complete commands, options, cases and keys of --set."""
    made = get_completion_class(shell)
    assert made is not None
    whole = click.get_current_context().find_root().command
    click.echo(made(whole, {}, "wavesim", "_WAVESIM_COMPLETE").source())

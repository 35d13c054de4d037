"""wavesim completion: what a shell completes, and the script that makes it so."""

from __future__ import annotations

import click
from click.shell_completion import CompletionItem, get_completion_class

_WHERE = {
    "bash": 'eval "$(wavesim completion bash)" in ~/.bashrc',
    "zsh": 'eval "$(wavesim completion zsh)" in ~/.zshrc',
    "fish": "wavesim completion fish | source in ~/.config/fish/config.fish",
}


def cases(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Names of shipped cases that begin so, and files."""
    from wavesim.case.shipped import shipped

    names = [CompletionItem(name) for name in shipped() if name.startswith(begun)]
    return [*names, CompletionItem(begun, type="file")]


def keys(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Keys of the case file's tables that begin so, as --set takes them."""
    from wavesim.case.schema import CaseFile

    found = []
    for name in ("medium", "bar", "time", "analysis"):
        table = CaseFile.model_fields[name].annotation
        found += [f"{name}.{key}=" for key in getattr(table, "model_fields", ())]
    found += [f"sources.0.{key}=" for key in ("field", "position", "peak_frequency", "width")]
    return [CompletionItem(key) for key in found if key.startswith(begun)]


@click.command(epilog="\n\n".join(f"{shell}: {where}" for shell, where in _WHERE.items()))
@click.argument("shell", type=click.Choice(tuple(_WHERE)))
def completion(shell: str) -> None:
    """Print what makes a SHELL complete commands, options, cases and keys of --set."""
    made = get_completion_class(shell)
    assert made is not None
    whole = click.get_current_context().find_root().command
    click.echo(made(whole, {}, "wavesim", "_WAVESIM_COMPLETE").source())

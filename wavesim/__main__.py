"""python -m wavesim: the command, as wavesim itself."""

from wavesim.cli.main import entry

if __name__ == "__main__":
    entry()

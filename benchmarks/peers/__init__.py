"""The contestants, one a file. Each offers ``Peer(problem)``, as ``contestant.py`` describes."""

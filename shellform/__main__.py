"""`python -m shellform`."""

from shellform.cli import main

main()

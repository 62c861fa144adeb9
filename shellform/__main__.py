"""`python -m shellform`."""

from shellform.cli.program import main

main()

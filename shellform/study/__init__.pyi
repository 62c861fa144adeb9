"""The public names of shellform.study, the one list of them."""

from shellform.case.case import load_case as load_case
from shellform.run.folder import read_run as read_run
from shellform.run.run import run_case as run_case
from shellform.study.plan import read_study as read_study
from shellform.study.store import read_table as read_table
from shellform.study.studies import run_study as run_study

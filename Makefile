# Everything from a fresh checkout: python3 (3.11 or newer) with venv, and make. On Debian: apt install python3-venv make
PYTHON ?= python3
BIN := .venv/bin
# Workers share the cores only when the linear algebra of each keeps to one.
export OPENBLAS_NUM_THREADS ?= 1
# Without bytecode every worker compiles all tests anew (8 s each), and every process that a test starts all of tango.
unexport PYTHONDONTWRITEBYTECODE
PYTEST := $(BIN)/python -m pytest -n auto --maxprocesses 4
SHARED := $(BIN)/python -m pytest -n 4 --dist loadgroup -vv --durations=25 --timeout 1800

.PHONY: demo test check-long check compiled campaign campaign-link campaign-net campaign-gateway campaign-readers campaign-nights-disk mutants blind design-table nights lint format clean planted

demo: .venv/base.stamp
	$(BIN)/tango demo

# One worker more than there are cores: many tests wait for a line. Who has nothing left takes tests of the others.
test: .venv/test.stamp
	$(BIN)/python -m pytest -n $$(n=$$(getconf _NPROCESSORS_ONLN); [ $$n -lt 4 ] && echo $$((n + 1)) || echo 4) --dist worksteal

# Four at a time: one of them waits, for the real control first and then for networks, and three compute
# (tests/support/shares.py). What hangs is named after half an hour instead of holding up everything.
check-long: .venv/test.stamp
	$(SHARED) -m 'long and not campaign'

# Both together, as .ci/run has them: while the long ones wait for a control or a network there is always something short to do.
check: .venv/test.stamp
	$(SHARED) -m 'not campaign'

# Every module that the tests import, once, instead of in each worker.
compiled: .venv/test.stamp
	$(BIN)/python -m compileall -q -j 2 tango_cnc sim_controller postprocessors
	-$(BIN)/python -m pytest --collect-only -m 'not campaign' >/dev/null

campaign: .venv/test.stamp
	$(BIN)/python -m pytest -m campaign

# 5000 sessions with faults, 1000 kills, a run at 9600 baud; TANGO_SESSIONS=300 TANGO_KILLS=30 for less.
campaign-link: .venv/test.stamp
	$(PYTEST) --dist load -m campaign tests/test_link_campaign.py tests/test_link_kills.py tests/test_link_9600.py -rP

# Sessions over real servers behind a network that breaks, one link or all: make campaign-net LINK=sftp TANGO_SESSIONS=1000
campaign-net: .venv/test.stamp
	$(BIN)/python -m pytest -m campaign tests/test_link_net_campaign.py -s $(if $(LINK),-k 'thousands and [$(LINK)-')

# Sessions behind a gateway that mixes requests up: 1000 in words, 1000 in frames of Modbus TCP, 1000 in frames of Modbus RTU.
campaign-gateway: .venv/test.stamp
	$(BIN)/python -m pytest -m campaign tests/test_link_gateway.py -s

# Spoilt files, 100 000 of each kind or N of one: make campaign-readers READER=machine.yaml N=20000 SEED=1000000
READERS := tests/test_files_spoilt.py::test_many_spoilt_files
campaign-readers: .venv/test.stamp
	TANGO_MUTANTS=$(or $(N),100000) TANGO_SEED=$(SEED) $(BIN)/python -m pytest -m campaign '$(READERS)$(if $(READER),[$(READER)])' -s

# Every call of a whole night that writes, SQLite's own with it, refused once, from then on and half taken.
campaign-nights-disk: .venv/test.stamp
	$(BIN)/python -m pytest tests/test_nightly_refusing_disk.py -m campaign -s

# Forty small mistakes in link, plan, check, read-back and posts: would the tests notice? make mutants SEED=7 draws the same ones again
# and goes on where it stopped; COUNT=100 for more; MINUTES=10 stops after that time; PART=2/4 beside parts 1, 3 and 4 shares the work.
mutants: .venv/test.stamp
	$(BIN)/python benchmarks/mutants.py $(if $(SEED),--seed $(SEED)) $(if $(COUNT),--count $(COUNT)) $(if $(PART),--part $(PART)) $(if $(MINUTES),--minutes $(MINUTES))

# Effects hidden in simulated readings by the hundred, and the confusion matrix of what the diagnosis makes of them.
# TANGO_STRATEGY=plan.yaml: the HU40T touches a plan of 'tango design' instead of its own 393 touches.
blind: .venv/test.stamp
	$(BIN)/python -m pytest tests/test_diagnose_blind.py tests/test_diagnose_outside.py -m campaign -s

# The table of docs/measured_design.md: make design-table ROW=hu40t/volume/10 for one row, which takes minutes; PARTS=1 with runs broken off.
design-table: .venv/test.stamp
	$(BIN)/python benchmarks/design_table.py $(ROW) $(if $(PARTS),--parts)

lint: .venv/test.stamp
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

# A simulated year of nights: make nights SEED=17. make nights YEARS=1000 SEED=0 JOBS=2 plays those years in two processes; years that
# are done on this code (build/years.jsonl) are not played again, and the last line is the sum of all. MINUTES=10 stops after that time.
nights: .venv/test.stamp
	$(BIN)/python benchmarks/years.py $(if $(YEARS),--years $(YEARS)) $(if $(SEED),--seed $(SEED)) $(if $(JOBS),--jobs $(JOBS)) $(if $(MINUTES),--minutes $(MINUTES))

# Bugs planted one at a time in the nights and the history: does the year of nights find each of them?
planted: .venv/test.stamp
	$(BIN)/python -m pytest tests/test_nights.py -m campaign -k planted -s

format: .venv/test.stamp
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# A stamp is newer than what it was made from, so a changed list of dependencies is installed by the next call.
.venv/base.stamp: pyproject.toml setup.py
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo 'Python 3.11 or newer is needed: make PYTHON=python3.11 …'; exit 1; }
	$(PYTHON) -m venv .venv || { echo 'python3 has no venv here. On Debian and Ubuntu: apt install python3-venv'; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

.venv/test.stamp: .venv/base.stamp
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	touch $@

clean:
	rm -rf .venv demo campaign build .pytest_cache .mypy_cache .ruff_cache .hypothesis *.egg-info

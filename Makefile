# Each target makes what it needs: the virtual environment and an LLVM library that Mitsuba can use.
# Another place for the environment: make VENV=/some/folder test

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: help demo test test-all lint docs dist bench bench-gpu bench-scaling accuracy validation statements attack clean llvm openfoam
.DEFAULT_GOAL := help

help:
	@echo 'make demo    trace the bundled scenes into out/ and write a report'
	@echo 'make test    run the quick tests'
	@echo 'make test-all  run all tests: OpenFOAM, the accuracy page, killed sweeps, fine fields'
	@echo 'make lint    check format, style, the direction of imports and types'
	@echo 'make docs    build the site into docs/_build/html; executes the gallery'
	@echo 'make dist    build the wheel and the source archive of the last commit into dist/'
	@echo 'make bench   print the speed ratios'
	@echo 'make bench-gpu  print the times of poses on a CUDA device, as a table to send in'
	@echo 'make bench-scaling  draw the time over rays, triangles and cells: docs/scaling.png'
	@echo 'make accuracy  compute docs/accuracy.md anew; PARTS="exact noise" computes some sections'
	@echo 'make validation  compare flows with solutions: docs/validation.md; two hours; PARTS="plate" computes some sections'
	@echo 'make openfoam  install OpenFOAM, which iriftrace field simulate runs, and repair it where needed'
	@echo 'make statements  compute docs/parts.md anew: what the paper says of its components'
	@echo 'make attack  damage files of every format and count what readers make of them: docs/reliability.md'
	@echo 'make clean   remove build folders and caches; .venv and out/ stay'

demo: $(VENV)/installed $(VENV)/drawing llvm
	$(BIN)/iriftrace demo -o out
	$(BIN)/iriftrace demo -o out --scene fringe_cylinder
	$(BIN)/iriftrace report out/fringe_cylinder_scan.vtp -o out/fringe_cylinder_report.html

# Most of a test is one thread of Python or VTK. What a file's tests share is made once.
TWO_AT_A_TIME = --numprocesses 2 --dist loadfile --no-loadscope-reorder

# Pytest rewrites and compiles each module of tests; the next run reads them, also where Python is told
# to write no bytecode.
test test-all: export PYTHONDONTWRITEBYTECODE =

test: $(VENV)/installed-dev $(VENV)/drawing llvm
	$(BIN)/python -m pytest $(TWO_AT_A_TIME)

test-all: $(VENV)/installed-dev $(VENV)/drawing llvm
	$(BIN)/python -m pytest $(TWO_AT_A_TIME) -m 'slow or not slow'

# The linter of imports and mypy follow one folder, so they get the package as it is once installed.
define rooms
@rm -rf build/imports && mkdir -p build/imports && cp -r iriftrace build/imports/ \
    && cp -r plugins build/imports/iriftrace/plugins
cd build/imports && PYTHONPATH=. $(abspath $(BIN))/lint-imports --config ../../pyproject.toml --no-cache
endef

lint: $(VENV)/installed-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/ruff check --preview --select PLW1514 iriftrace plugins scenes validation bench tools
	$(call rooms)
	cd build/imports && $(abspath $(BIN))/mypy --config-file ../../pyproject.toml

docs: $(VENV)/installed-dev $(VENV)/drawing llvm
	$(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet docs docs/_build/html

# From the last commit alone, so that no other file of this folder gets in, and with its time, one owner
# and one mode in both archives: the same commit and setuptools give the same bytes. GNU tar sorts.
dist: $(VENV)/installed-dev
	rm -rf build/dist dist
	mkdir -p build/dist
	umask 022 && git archive HEAD | tar -x --no-same-permissions -C build/dist
	umask 022 && export SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) && \
	    $(BIN)/python -m build --quiet --outdir dist build/dist && cd dist && for sdist in *.tar.gz; do \
	        tar -xzf $$sdist && tar --sort=name --mtime=@$$SOURCE_DATE_EPOCH --owner=0 --group=0 \
	            --numeric-owner -c $${sdist%.tar.gz} | gzip -9n >$$sdist.new && \
	        mv $$sdist.new $$sdist && rm -r $${sdist%.tar.gz}; done
	$(BIN)/python -m twine check --strict dist/*

bench: $(VENV)/installed llvm
	$(BIN)/python -m bench

bench-gpu: $(VENV)/installed llvm
	$(BIN)/python -m bench.gpu

bench-scaling: $(VENV)/installed $(VENV)/drawing llvm
	$(BIN)/python -m bench.scaling

accuracy: $(VENV)/installed-dev llvm
	$(BIN)/python -m validation $(PARTS)

validation: $(VENV)/installed-dev llvm
	$(BIN)/python -m validation.flow $(PARTS)

statements: $(VENV)/installed $(VENV)/drawing llvm
	$(BIN)/python -m validation.statements

attack: $(VENV)/installed-dev $(VENV)/drawing llvm
	$(BIN)/python -m validation.attack --write

clean:
	rm -rf build dist docs/_build docs/api docs/gallery docs/sg_execution_times.rst *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +

$(VENV)/installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	    echo "iriftrace needs Python 3.11 or newer: make PYTHON=python3.12 ..." >&2; exit 1; }
	@echo 'Installing iriftrace and what it needs into $(VENV) (a few minutes the first time)'
	@$(PYTHON) -m venv $(VENV)
	@$(PIP_INSTALL) --editable .
	@touch $@

$(VENV)/installed-dev: $(VENV)/installed
	@$(PIP_INSTALL) --editable '.[dev]'
	@touch $@

# $(call apt_install,PACKAGES) succeeds only where apt is there and may be used without a password.
apt_install = { command -v apt-get >/dev/null && \
    if [ "$$(id -u)" = 0 ]; then as_root=; else as_root=sudo; sudo -n true 2>/dev/null; fi && \
    echo 'Installing $(1) with apt' && $$as_root apt-get update -qq && \
    $$as_root apt-get install -y -qq --no-install-recommends $(1) >/dev/null; }

# The package itself says whether LLVM is usable, so that make and iriftrace cannot disagree.
WORKS = $(BIN)/python -c 'from iriftrace.core.runtime.variant import ensure; ensure()'

llvm: $(VENV)/installed
	@$(WORKS) 2>/dev/null || { \
	    [ -z "$$DRJIT_LIBLLVM_PATH" ] && $(WORKS) 2>&1 | grep -q 'apt-get install' && \
	    { $(call apt_install,libllvm19 libatomic1) || $(call apt_install,llvm libatomic1); } && \
	    $(WORKS) 2>/dev/null; \
	} || { $(WORKS) 2>&1 | tail -n 1 | sed 's/^iriftrace.core.errors.SetupError: //' >&2; exit 1; }

# VTK draws the 3-D picture; without a driver there is none, and the rest goes on.
DRAWS = $(BIN)/python -c 'import sys; from iriftrace.core.runtime.doctor import drawing_trouble as t; sys.exit(t() or 0)'

$(VENV)/drawing: $(VENV)/installed
	@$(DRAWS) 2>/dev/null || $(call apt_install,libegl1 libgl1-mesa-dri) || \
	    echo 'No OpenGL driver: 3-D pictures are left out (iriftrace doctor says how to mend it)' >&2
	@touch $@

# Debian 12's solvers are miscompiled: then one of them is built again from the package's source, into
# the user's own data folder. The package itself says whether that is needed.
FINDS_FOAM = $(BIN)/python -c 'from iriftrace.flow.simulate.programs import find_openfoam as f; f()'
COMPUTES_RIGHT = $(BIN)/iriftrace field doctor >/dev/null 2>&1

openfoam: $(VENV)/installed $(VENV)/drawing llvm
	@$(FINDS_FOAM) 2>/dev/null || $(call apt_install,openfoam) || { \
	    echo 'OpenFOAM is missing and cannot be installed here with apt: sudo apt-get install openfoam,' \
	        'or a package of openfoam.com' >&2; exit 1; }
	@$(COMPUTES_RIGHT) || command -v g++ >/dev/null || $(call apt_install,g++) || { \
	    echo 'g++ is missing, which builds the solver again: sudo apt-get install g++' >&2; exit 1; }
	@$(COMPUTES_RIGHT) || $(BIN)/python tools/openfoam/build_solver.py
	@$(BIN)/iriftrace field doctor

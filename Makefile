RUN = scripts/in-env
RESULTS = results
ARGS =

.DEFAULT_GOAL := help
.PHONY: help demo demo-stocking test lint house format verify test-next bench docs paper clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' Makefile | expand -t 12

demo: ## identify subject 3, from nothing
	$(RUN) python -m legfem.identify --subject 3 $(ARGS)

demo-stocking: ## a leg in a compression stocking, from its scans
	$(RUN) python -m legfem.stocking --subject 1 $(ARGS)

# A file stays in one process, where its fixtures are made once.
test: lint ## lint, types and the fast tests
	$(RUN) python -m pytest -n 2 --dist loadfile $(ARGS)

lint: ## ruff, mypy, which room imports which, and the house's limits
	$(RUN) ruff check
	$(RUN) ruff format --check
	$(RUN) mypy
	$(RUN) lint-imports
	$(RUN) scripts/house --gates

house: ## count code lines by room
	$(RUN) scripts/house $(ARGS)

format: ## put the code into ruff's format
	$(RUN) ruff check --fix
	$(RUN) ruff format

verify: ## the slow tests, the convergence study, and the site without running its examples
	$(RUN) python -m pytest -m slow -n 2 --dist loadfile $(ARGS)
	$(RUN) python -m studies.frauziols convergence
	$(MAKE) docs ARGS="-D plot_gallery=0 -D nb_execution_mode=off"

# Types are those of one version of petsc4py and NumPy: `make test` checks them.
test-next: ## the fast tests on Debian unstable's DOLFINx
	LEGFEM_SUITE=sid $(RUN) python -m pytest -n 2 --dist loadfile $(ARGS)

bench: ## count what legfem takes, beside the last release
	$(RUN) python -m studies.bench $(ARGS)

docs: ## the site, in docs/_build/html; runs the gallery and the notebooks
	LEGFEM_DOCS=1 $(RUN) python -m sphinx -W --keep-going -c docs -d docs/_build/doctrees . docs/_build/html $(ARGS)

paper: ## the draft of a paper, in docs/paper/_build/paper.pdf; its numbers are the pages' own
	LEGFEM_DOCS=1 $(RUN) python docs/paper/build.py

clean: ## remove what the commands and tools wrote here
	rm -rf $(RESULTS) build dist docs/_build docs/gallery docs/paper/_build .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
	rm -rf ./*.egg-info

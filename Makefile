# What one does in a clone. `make` alone tells.

ENGINE := .engine/bin
# As the engine starts itself: on several threads BLAS sums in another order from run to run.
ENGINE_ENV := OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1
QGIS_PYTHON := /usr/bin/python3
# QGIS without a window, with a profile of its own and the plugin under its right name.
QGIS_ENV := QT_QPA_PLATFORM=offscreen QGIS_CUSTOM_CONFIG_PATH="$(CURDIR)/.build/profile" QGIS_PLUGINPATH="$(CURDIR)/.build/plugins"

.DEFAULT_GOAL := help
.PHONY: help setup demo test floor everyqgis lint bench strings models package

help: ## show this
	@grep -E '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## (.*)/  make \1|\2/' | column -t -s '|'

setup: ## install QGIS (Debian) and the engine where they are missing
	@scripts/setup

demo: setup ## from simulated photographs to volumes, through QGIS; the results are in demo/
	$(QGIS_ENV) $(ENGINE)/python scripts/demo.py

test: setup ## all tests: the engine's, then those that go through QGIS
	$(ENGINE_ENV) $(ENGINE)/python -m pytest tests/core
	@$(MAKE) --no-print-directory floor

floor: setup ## the tests that go through QGIS
	$(QGIS_ENV) timeout 1200 $(QGIS_PYTHON) -m pytest -W "ignore:Unknown config option" tests/qgis

everyqgis: ## the same on QGIS 3.22, 3.40 and 3.44, each in a Debian of its own (root)
	@scripts/everyqgis

lint: setup ## style, types and spelling
	$(ENGINE)/ruff check .
	$(ENGINE)/ruff format --check .
	cd .build/plugins && "$(CURDIR)/$(ENGINE)/mypy" --config-file "$(CURDIR)/pyproject.toml" -p strandline.core
	$(ENGINE)/codespell

bench: setup ## speed and memory, beside a peer in the same run
	@peer=../shared/peers/dsm_sketch_kernels.py; [ -f $$peer ] || peer=; NUMBA_NUM_THREADS=1 $(ENGINE)/python tests/benchmarks/bench_surface.py $$peer
	@$(ENGINE)/python tests/benchmarks/bench_difference.py
	@OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(ENGINE)/python tests/benchmarks/bench_features.py
	@OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(ENGINE)/python tests/benchmarks/bench_matching.py
	@$(ENGINE)/python tests/benchmarks/bench_enhance.py
	@OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(ENGINE)/python tests/benchmarks/bench_georeference.py

strings: ## collect the words to translate into i18n/*.ts
	$(QGIS_PYTHON) scripts/strings.py

models: setup ## make models/*.model3 again from scripts/build_models.py
	QT_HASH_SEED=0 $(QGIS_ENV) $(QGIS_PYTHON) scripts/build_models.py

package: ## the plugin as a zip in dist/, to install from QGIS's plugin manager
	$(QGIS_PYTHON) scripts/package.py

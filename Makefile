# Everything runs in a virtual environment of the checkout's own.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: app test figures schemas bench surveys motions robots opening previews cancelling background grids cells

app: $(VENV)/app.stamp  ## install, then start the page
	$(BIN)/symgrasp app $(ARGS)

test: $(VENV)/dev.stamp  ## install, then run every check and test; browsers one by one, as they need all cores
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright
	$(BIN)/pytest -m 'not browser' $(ARGS)
	$(BIN)/pytest -m browser -n0 $(ARGS)

$(BIN)/python:
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
	$(PYTHON) -m pip install --quiet --target $(VENV)-boot virtualenv && \
	PYTHONPATH=$(VENV)-boot $(PYTHON) -m virtualenv $(VENV); }

$(VENV)/app.stamp: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable '.[motion,robots,survey]'
	touch $@

$(VENV)/dev.stamp: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	touch $@ $(VENV)/app.stamp

figures: $(VENV)/dev.stamp  ## make the pictures of the README and docs/ again
	$(BIN)/python -m docs.figures $(ARGS)

schemas: $(VENV)/dev.stamp  ## write the JSON Schemas of the file formats again
	$(BIN)/python -m docs.schemas

bench: $(VENV)/dev.stamp  ## measure, and write the times of the README and docs/speed.md (minutes)
	$(BIN)/symgrasp bench --out docs/bench.json
	$(BIN)/python -m docs.speed

surveys: $(VENV)/dev.stamp  ## measure what surveys cost, and write it to docs/surveys.md (minutes)
	$(BIN)/symgrasp bench survey --out docs/surveys.json
	$(BIN)/python -m docs.surveys

motions: $(VENV)/dev.stamp  ## measure how fast motions are planned, and write it to docs/motions.md (minutes)
	$(BIN)/symgrasp bench motion --out docs/motions.json
	$(BIN)/python -m docs.motions

robots: $(VENV)/dev.stamp  ## measure every robot of the catalogue, and write the table of docs/robots.md (minutes)
	$(BIN)/symgrasp bench robots --out docs/robots.json
	$(BIN)/python -m docs.robots

opening: $(VENV)/dev.stamp  ## print how long the page takes to open, and to show robots (ARGS="pr2 talos": these)
	$(BIN)/python -m docs.opening $(ARGS)

previews: $(VENV)/dev.stamp  ## print how long the page takes to preview the grasp that is pointed at, in Chromium
	$(BIN)/python -m docs.previews

cancelling: $(VENV)/dev.stamp  ## print how long what the page computes goes on after a cancel (minutes)
	$(BIN)/python -m docs.cancelling $(ARGS)

background: $(VENV)/dev.stamp  ## print how long the page waits for maps while a survey runs, and while none does
	$(BIN)/python -m docs.background

grids: $(VENV)/dev.stamp  ## measure coarse and fine grids of every shipped scene, and write docs/grids.md (minutes)
	$(BIN)/python -m docs.grids
	$(BIN)/python -m docs.figures grids

cells: $(VENV)/dev.stamp  ## measure what is proven of the cells of every shipped scene, and write it to docs/grids.md
	$(BIN)/python -m docs.cells

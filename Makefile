# NeNa: all commands for developers and users. `make` alone lists them.
SHELL := bash
.SHELLFLAGS := -euo pipefail -c
VENV := .venv
BIN := $(VENV)/bin
# The first supported interpreter that runs; `make PYTHON=...` overrides it.
PYTHON ?= $(shell for p in python3.12 python3.13 python3.14 python3.11 python3; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && command -v $$p && break; done)
DISTRIBUTIONS := shared $(addprefix services/,order_service edge_agent status_aggregator) $(addprefix tools/,plant_formats robot_simulator client conversations cli demo deploy simulate)
SOURCES := $(DISTRIBUTIONS:%=%/src)
# Processes that run tests in parallel; each test has its own ROS domain, broker and ports.
WORKERS ?= 2
# Tests of whole sites wait for robots about half of the time: four keep two cores busy.
test test-all: WORKERS = 4
# Tests of whole sites come first in the list; workstealing then spreads them over the workers.
SHARED_OUT = -n $(WORKERS) --dist worksteal
COVERED := --cov --cov-report=xml --cov-fail-under=85
# Property tests: more examples find more.
SOAK := tests/unit/shared/vda5050/test_round_trip.py tests/unit/shared/vda5050/test_records.py \
	tests/unit/edge_agent/protocol/test_robot_machine.py tests/unit/edge_agent/nav2/test_goal_tracker_property.py \
	tests/unit/robot_simulator/test_navigator.py \
	tests/unit/order_service/traffic/test_simulation.py tests/unit/order_service/test_traffic_simulation.py \
	tests/unit/edge_agent/test_restart_safety.py tests/integration/edge_agent/nav2/test_kills.py \
	tests/integration/edge_agent/nav2/test_session.py tests/integration/edge_agent/nav2/test_table_of_deaths.py tests/faults/test_recovery.py
# Parsers of external input.
FUZZED := tests/fuzz tests/unit/plant_formats/lif/test_damaged_files.py tests/unit/plant_formats/opentcs_xml/test_damaged_files.py
STAMP := $(VENV)/.set-up
define NEEDS_PYTHON
@[ -n "$(PYTHON)" ] || { echo "NeNa needs CPython 3.11 or newer with venv. On Debian or Ubuntu: apt-get install python3 python3-venv. Or name one: make PYTHON=/path/to/python3.12 setup" >&2; exit 1; }
endef
# Tests start programs by the hundred, which need not be compiled each time.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup action-types wheels check-wheels lock format lint test test-unit test-all soak soak-cores soak-site soak-pauses soak-nemesis oidc-test docs compose-test colcon-test kilted-test firefox-test nav2-test smoke demo bench conversations hooks clean broker brokers brokers-more brokers-test browser monitoring alerts-test sbom fuzz faults conformance reference

help: ## list these commands
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F':.*## ' '{printf "  make %-13s %s\n", $$1, $$2}'

setup: $(STAMP) action-types ## create .venv with all services

# With --no-deps pip installs what is pinned and searches for nothing else: otherwise pip 23 fails as soon as a package
# behind an extra, such as coverage[toml], has a release newer than its pin. Quiet twice: errors, but no warnings of
# Debian's pip about the packages of others.
$(STAMP): requirements/dev.txt $(DISTRIBUTIONS:%=%/pyproject.toml)
	$(NEEDS_PYTHON)
	@[ -x $(BIN)/python ] || "$(PYTHON)" -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --quiet --no-deps --require-hashes -r requirements/dev.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation $(DISTRIBUTIONS:%=-e %)
	$(BIN)/python -m pip check
	@touch $@

# For the simulator and the tests only: robots have the real ones.
action-types: $(STAMP) ## build Nav2's action types in .venv (needs a compiler; without them only topics are used)
	@$(BIN)/python -m nena_robot_simulator.interfaces

lock: $(STAMP) ## pin requirements/dev.in again, with hashes
	$(BIN)/uv pip compile requirements/dev.in --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-emit-find-links --quiet --custom-compile-command "make lock" -o requirements/dev.txt
	deploy/containers/lock

# In an environment of its own, so that a machine that only builds wheels need not download what developers need.
$(VENV)/build/.set-up: requirements/build.txt
	$(NEEDS_PYTHON)
	"$(PYTHON)" -m venv $(VENV)/build
	$(VENV)/build/bin/pip install --quiet --no-deps --require-hashes -r requirements/build.txt
	@touch $@

wheels: $(VENV)/build/.set-up ## build the wheels of all programs into build/wheels
	rm -rf build/wheels
	$(VENV)/build/bin/pip wheel --quiet --no-deps --no-build-isolation --wheel-dir build/wheels $(DISTRIBUTIONS:%=./%)

check-wheels: $(STAMP) ## check that each pinned dependency has a wheel for CPython 3.11 to 3.14, x86-64 and Arm
	deploy/check-wheels

format: $(STAMP) ## format the code
	$(BIN)/ruff check --fix --quiet . ; $(BIN)/ruff format --quiet .

sbom: $(STAMP) ## write the bill of materials of each program (CycloneDX) to build/sbom
	@mkdir -p build/sbom
	for each in order_service status_aggregator edge_agent-ros robot_simulator-ros; do \
		$(BIN)/cyclonedx-py requirements requirements/$$each.txt --pyproject $$(ls {services,tools}/$${each%-ros}/pyproject.toml 2>/dev/null) \
			--mc-type application --output-reproducible -o build/sbom/$$each.json; done

lint: $(STAMP) ## check style, types, import rules and known vulnerabilities
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python deploy/lines
	$(BIN)/bandit --quiet -ll --recursive $(SOURCES)
	deploy/audit

test-unit: $(STAMP) ## unit tests only: no broker, ROS, browser or simulated plants; about three minutes
	$(BIN)/pytest tests/unit $(SHARED_OUT) -m "not broker and not postgres and not ros and not e2e and not simulation"

test: $(STAMP) action-types broker brokers browser monitoring ## all tests but the long ones; TESTS=path runs a part of them
	$(BIN)/pytest $(SHARED_OUT) $(TESTS)

test-all: $(STAMP) action-types broker brokers browser monitoring ## all tests, with long and quarantined ones and branch coverage, then check-wheels, soak-cores, fuzz and faults: several hours
	NENA_LISTED_WITHIN=5 $(BIN)/pytest $(SHARED_OUT) $(COVERED) --long
	$(MAKE) check-wheels soak-cores fuzz faults

conformance: $(STAMP) ## regenerate docs/vda5050.md: conformance clause by clause, with its tests
	PYTHONPATH=tests $(BIN)/python -m conformance.table

# In an environment of its own: MkDocs is no part of the programs or of their tests.
$(VENV)/docs/.set-up: requirements/docs.txt $(STAMP)
	$(BIN)/python -m venv $(VENV)/docs
	$(VENV)/docs/bin/pip install --quiet --no-deps --require-hashes -r requirements/docs.txt
	@touch $@

docs: $(VENV)/docs/.set-up reference conformance ## write the generated pages, and build the docs as a site with search into build/docs; broken links are errors
	NO_MKDOCS_2_WARNING=1 $(VENV)/docs/bin/mkdocs build --strict # not --quiet, which hides warnings from --strict
	@echo "To read it: python -m http.server --directory build/docs --bind 127.0.0.1 8000"

reference: $(STAMP) ## regenerate docs/configuration.md, docs/metrics.md, docs/compatibility.md, docs/opentcs-web-api.md, docs/problems.md and docs/mqtt-api.md
	PYTHONPATH=tests $(BIN)/python -m reference.configuration
	PYTHONPATH=tests $(BIN)/python -m reference.metrics
	PYTHONPATH=tests $(BIN)/python -m reference.compatibility
	PYTHONPATH=tests $(BIN)/python -m reference.opentcs_web_api
	PYTHONPATH=tests $(BIN)/python -m reference.problems
	PYTHONPATH=tests $(BIN)/python -m reference.mqtt_api

soak: soak-site soak-pauses soak-nemesis soak-cores ## soak-site, soak-pauses, soak-nemesis, then soak-cores

soak-cores: $(STAMP) broker ## property tests of the cores with many more examples: about two hours on two cores
	NENA_EXAMPLES=100000 NENA_MESSAGES=2000 NENA_PLANTS=400 NENA_ENGINE_PLANTS=400 NENA_RESTARTS=1000 NENA_KILLS=40 NENA_SESSIONS=200 NENA_ORDER_KILLS=50 $(BIN)/pytest --long -n $(WORKERS) --timeout 7200 $(SOAK)

# Cut network links and full disks need root; without it these tests are skipped with a message.
faults: $(STAMP) broker ## inject every kind of fault into a working site, about three quarters of an hour; writes docs/recovery.md
	rm -f build/recovery.jsonl build/standstill.jsonl
	NENA_FAULTS=3 $(BIN)/pytest tests/faults --long --timeout 3600
	PYTHONPATH=tests $(BIN)/python -m faults.table

# A full disk needs root, a wrong clock a C compiler; without them these tests are skipped with a message.
alerts-test: $(STAMP) broker monitoring ## cause faults at a site under Prometheus and Alertmanager: the right alert within 15 s, and no other
	NENA_ALERT_WITHIN=15 $(BIN)/pytest --long tests/alerts

MINUTES ?= 120
soak-site: $(STAMP) broker ## run a site for two hours (or MINUTES=10): memory, latency, drift; writes docs/soak.md
	PYTHONPATH=tests $(BIN)/python -m faults.soak --minutes $(MINUTES)

PAUSES ?= 50
soak-pauses: $(STAMP) broker ## suspend the active order service for 1 to 60 s, 50 times (or PAUSES=8), with robots of three kinds
	PYTHONPATH=tests $(BIN)/python -m faults.pauses --pauses $(PAUSES)

SEEDS ?= 200
FIRST ?= 1
soak-nemesis: $(STAMP) broker ## 200 sites (or SEEDS=10 FIRST=1) under faults that a seed draws, with robots of three kinds: three hours
	PYTHONPATH=tests $(BIN)/python -m faults.nemesis --seeds $(SEEDS) --first $(FIRST)

# The damage is the same on each run; NENA_FUZZ_SEED=anything chooses other damage.
fuzz: $(STAMP) broker ## fuzz every parser and both HTTP interfaces, for a long time
	NENA_FUZZ_EXAMPLES=200 NENA_FUZZ_MESSAGES=20000 NENA_FUZZ_FILES=5000 $(BIN)/pytest --long -n $(WORKERS) --timeout 7200 $(FUZZED)

# IMAGES=... is a command that provides the base images first, where there is no registry.
IMAGES ?=
compose-test: $(STAMP) ## build every image, start the stack with docker-compose, and run orders on a robot in it
	$(IMAGES)
	NENA_COMPOSE_TEST=1 $(BIN)/pytest tests/deploy/test_compose.py tests/deploy/test_compose_site.py tests/deploy/test_image_on_ros.py tests/deploy/test_images_of_others.py

# From npm, with the hashes of its lock file; needs Node.js 20.
oidc-test: $(STAMP) broker ## sign in at the panel and use tokens with a real OpenID Connect issuer (npm's oidc-provider)
	mkdir -p $(VENV)/oidc-provider && cp tests/security/oidc_provider/package*.json $(VENV)/oidc-provider
	cd $(VENV)/oidc-provider && npm ci --ignore-scripts --no-audit --no-fund
	NENA_OIDC_PROVIDER=$(abspath $(VENV))/oidc-provider $(BIN)/pytest tests/security/test_real_issuer.py

peers-test: $(STAMP) broker ## the edge agent and the order service with npm's vda-5050-lib as the other side
	mkdir -p $(VENV)/vda-5050-lib && cp tests/integration/peers/node/package*.json $(VENV)/vda-5050-lib
	cd $(VENV)/vda-5050-lib && npm ci --ignore-scripts --no-audit --no-fund
	NENA_VDA_5050_LIB=$(abspath $(VENV))/vda-5050-lib $(BIN)/pytest tests/integration/peers

# BROKER=host:port or user:password@host:port: a broker of yours instead, which is not restarted.
BROKER ?=
brokers-test: $(STAMP) broker brokers ## run orders, restarts and cut links on each MQTT broker that is installed, or on BROKER=host:port; writes docs/brokers.md
	@NENA_BROKER='$(BROKER)' $(BIN)/pytest --long $(or $(TESTS),tests/brokers)
	PYTHONPATH=tests $(BIN)/python -m brokers.table

# At a site: NAV2="--domain 7 --namespace r1 --start 0,0 --end 4,0 --kill '...' --revive '...'".
NAV2 ?= --simulator
nav2-test: $(STAMP) action-types broker ## test the edge agent with a running Nav2 (NAV2="--domain 7 ..."); writes build/nav2-test.md
	PYTHONPATH=tests $(BIN)/python -m nav2_acceptance $(NAV2)

# In an environment of its own, with the ROS packages of Kilted in place of those in dev.txt.
$(VENV)/kilted/.set-up: requirements/kilted.txt $(STAMP)
	$(BIN)/python -m venv $(VENV)/kilted
	awk '/^[^ #]/ {other = !/^ros-/} other' requirements/dev.txt > $(VENV)/kilted/others.txt
	for each in $(VENV)/kilted/others.txt requirements/kilted.txt; do \
		$(VENV)/kilted/bin/pip install --quiet --quiet --no-deps --require-hashes -r $$each; done
	$(VENV)/kilted/bin/pip install --quiet --no-deps --no-build-isolation $(DISTRIBUTIONS:%=-e %)
	$(VENV)/kilted/bin/python -m nena_robot_simulator.interfaces
	@touch $@

# Later versions of Playwright send commands that Firefox ESR does not know.
$(VENV)/firefox/.set-up: requirements/firefox.txt $(STAMP)
	$(BIN)/python -m pip install --quiet --quiet --no-deps --require-hashes --upgrade --target $(@D) -r $<
	@touch $@

firefox-test: $(VENV)/firefox/.set-up broker ## the panel's tests in Firefox instead of Chromium, about an hour (TESTS=path for a part)
	@command -v firefox-esr >/dev/null || command -v firefox >/dev/null || $(call install,firefox-esr)
	NENA_BROWSER=firefox PYTHONPATH=$(abspath $(VENV))/firefox $(BIN)/pytest $(SHARED_OUT) $(or $(TESTS),tests/e2e/panel)

OTHER_ROS := tests/integration/edge_agent/nav2/test_other_distribution.py
kilted-test: $(VENV)/kilted/.set-up action-types broker ## the edge agent's tests on the wheels of ROS 2 Kilted, and with Jazzy in one domain (TESTS=path for a part)
	NENA_OTHER_ROS=$(BIN) $(VENV)/kilted/bin/pytest $(OTHER_ROS)
	NENA_OTHER_ROS=$(VENV)/kilted/bin $(BIN)/pytest $(OTHER_ROS)
	$(VENV)/kilted/bin/pytest $(SHARED_OUT) $(or $(TESTS),tests/integration/edge_agent)

colcon-test: $(STAMP) broker ## build the edge agent as a ROS package with colcon, and start the installed agent
	@[ -x $(VENV)/colcon/bin/colcon ] || { $(BIN)/python -m venv $(VENV)/colcon && \
		$(VENV)/colcon/bin/pip install --quiet --no-deps --require-hashes -r requirements/colcon.txt; }
	COLCON=$(abspath $(VENV))/colcon/bin/colcon $(BIN)/pytest tests/deploy/test_ros_package.py

smoke: $(STAMP) action-types broker ## the demo unattended: two robots, two orders, a check of the final state
	$(BIN)/nena-demo smoke

demo: $(STAMP) action-types broker ## a hall with a guided tour on this machine, until q or Ctrl-C (ROBOTS=50 for more robots)
	$(BIN)/nena-demo run $(if $(ROBOTS),--robots $(ROBOTS))

bench: $(STAMP) action-types broker ## measure latencies, CPU, memory and traffic (BENCH="--beside ../older --rounds 3 --entries orders")
	PYTHONPATH=tests $(BIN)/python -m bench $(BENCH)

conversations: $(STAMP) broker ## record the conversations in tests/fixtures again, from real agents
	PYTHONPATH=tests $(BIN)/python -m support.conversations

# Parts from the system's packages. Where they cannot be installed, the demo uses the Python broker, and
# tests report what is missing.
broker:
	@PATH=$$PATH:/usr/sbin; { command -v mosquitto && command -v mosquitto_pub; } >/dev/null || $(call install,mosquitto mosquitto-clients)

# Debian starts these as services where it can. The tests do not use these, but start their own.
brokers:
	@PATH=$$PATH:/usr/sbin; { command -v rabbitmq-server && command -v nats-server; } >/dev/null || $(call install,rabbitmq-server nats-server)

# Aedes from npm; needs Node.js 20.
brokers-more: ## install the other brokers that brokers-test knows: ejabberd, ActiveMQ, Aedes
	@{ command -v ejabberdctl && [ -e /usr/share/activemq/bin/activemq.jar ] && [ -e /usr/share/java/mqtt-client.jar ]; } >/dev/null || \
		$(call install,ejabberd activemq libmqtt-client-java)
	mkdir -p $(VENV)/aedes
	cd $(VENV)/aedes && npm install --ignore-scripts --no-audit --no-fund --no-package-lock aedes@1.2.0

monitoring:
	@{ command -v promtool && command -v prometheus-alertmanager; } >/dev/null || $(call install,prometheus prometheus-alertmanager)

browser:
	@command -v chromium >/dev/null || command -v chromium-browser >/dev/null || $(call install,chromium)

define install
{ root=""; [ "$$(id -u)" = 0 ] || root="sudo -n"; \
  { command -v apt-get && { [ -z "$$root" ] || $$root true; } && $$root apt-get update -qq && \
    DEBIAN_FRONTEND=noninteractive $$root apt-get -o DPkg::Lock::Timeout=300 install -y -qq --no-install-recommends $(1); } >/dev/null 2>&1 \
  || echo "$(1) is not on this machine and could not be installed; by hand: apt-get install $(1)" >&2; }
endef

hooks: $(STAMP) ## install the pre-commit hooks
	$(BIN)/pre-commit install

clean: ## remove what make setup created
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis htmlcov .coverage*

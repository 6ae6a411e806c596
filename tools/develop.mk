# Goals of developers, and the packages and the build that every goal needs:
#
#   make -f Makefile.pipeline check           packages, build, and every test; the readers' under the sanitizers
#   make -f Makefile.pipeline sanitize        all tests of the libraries under the sanitizers
#   make -f Makefile.pipeline tsan            what runs in threads under the thread sanitizer
#   make -f Makefile.pipeline fuzz            the readers under libFuzzer: SECONDS each, or of PARSER alone
#   make -f Makefile.pipeline charts          sweeps the choices on scenes with a known truth, draws time against error
#   make -f Makefile.pipeline stability       packages, build, and the maps of docs/stability.md anew
#   make -f Makefile.pipeline history         packages, build, a line of times for docs/tables/history.tsv, and what is slower
#   make -f Makefile.pipeline scene-membrane  packages, build, and a scene with contact: scene-liver, scene-angioplasty, scene-lens
#   make -f Makefile.pipeline package         Debian packages in build/packages; package-check installs them in a new system
#   make -f Makefile.pipeline site            the documentation as HTML in build/site
#   make -f Makefile.pipeline tarball         the sources of the last commit in build
#
# `setup` and `build` are goals of their own.

#:
#: Of other targets:
#: MAPS       of `stability`: maps whose names begin so, by commas  [all]
#: CELL       of `stability`: one cell, e.g. ring-default/2-3, that leaves its scene, mesh and report in OUT
#: VESSEL DEPOSITS   of `scene-angioplasty`: a mesh of shells and one of tetrahedra of your own  [the sample's]
#: BALLOON    of `scene-angioplasty` with VESSEL: where it goes, e.g. 'from=-8,0,0 to=8,0,0 inflated=2', see docs/scenes.md
#: HISTORY FACTOR   of `history`: the table that grows by a line, and how many times the median is slower  [docs/tables/
#:            history.tsv, 1.25]
#: SECONDS PARSER   of `fuzz`: how long each parser is fuzzed, and which ones, by commas  [60, all]
#: REPORTS    of `charts`: folder of the runs' reports, each with its command  [build/charts]
#: CHARTS     of `charts`: folder of the drawings and their numbers  [REPORTS/drawn]
#: DATA       of `charts`: folder with volumes/ of real organs, which join the phantoms
#: PAPER      of `charts`: folder with the meshes of the paper's Fig. 6

to_build := g++ cmake ninja-build ccache libcgal-dev libassimp-dev libopencv-core-dev \
  libopencv-imgproc-dev libcairo2-dev libfreetype-dev \
  libeigen3-dev libsuitesparse-dev libhdf5-dev libtbb-dev libfmt-dev libcli11-dev libtomlplusplus-dev \
  nlohmann-json3-dev zlib1g-dev libpng-dev libtiff-dev libssl-dev libexpat1-dev lowdown
to_run := python3
to_test := libgtest-dev libgmock-dev python3-numpy python3-h5py python3-nibabel python3-vtk9 chromium calculix-ccx \
  man-db groff zsh fish
packages_most := $(to_build) $(to_run) $(to_test)
packages_fuzz := $(packages_most) clang-16 libclang-rt-16-dev
packages_package := $(to_build) dpkg-dev debhelper fakeroot
packages_package-check := $(packages_most) lintian debootstrap binutils qemu-user
packages_site := python3-sphinx python3-myst-parser python3-sphinx-rtd-theme blahtexml
# Of all goals at once: they are set up for once.
packages := $(sort $(foreach goal,$(or $(MAKECMDGOALS),pipeline),$(or $(packages_$(goal)),$(packages_most))))

scenes := scene-membrane scene-liver scene-angioplasty scene-lens
.PHONY: setup build check sanitize tsan fuzz package package-check site tarball stability history charts $(scenes)

# The cases are looked at before anything is installed or built.
ifneq ($(filter pipeline,$(or $(MAKECMDGOALS),pipeline)),)
setup: cases
endif
.PHONY: cases
cases:
	@! command -v python3 > /dev/null || python3 -BE $(root)tools/pipeline.py --check

setup:
	@if ! command -v apt-get > /dev/null; then \
	  echo 'setup: no apt-get on this machine, its own packages for these are needed: $(packages)'; exit 0; \
	fi; \
	missing=; \
	for package in $(packages); do \
	  dpkg-query -W -f='$${Status}' $$package 2> /dev/null | grep -q 'ok installed' || missing="$$missing $$package"; \
	done; \
	if [ -z "$$missing" ]; then echo 'setup: every package is there'; exit 0; fi; \
	echo "setup: apt-get install$$missing"; \
	as_root=; \
	if [ "$$(id -u)" != 0 ]; then \
	  command -v sudo > /dev/null || { echo 'setup: needs root for that, and there is no sudo' >&2; exit 1; }; \
	  as_root=sudo; \
	fi; \
	install() { $$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends $$missing; }; \
	if apt-get install -s --no-install-recommends $$missing > /dev/null 2>&1 && install; then exit 0; fi; \
	echo 'setup: apt-get update'; \
	$$as_root apt-get update -q && install

tools := $(patsubst $(root)tools/%.cpp,tunica-%,$(wildcard $(root)tools/*.cpp))

build: setup
	cd $(root) && cmake --preset release && cmake --build --preset release --target $(tools) documentation

check: setup
	cd $(root) && cmake --preset release && cmake --build --preset release && ctest --preset release -j "$$(nproc)"

# Everything but the whole-tool tests under these sanitizers: half an hour on two cores.
sanitize: setup
	cd $(root) && cmake --preset check && cmake --build --preset check && ctest --preset check -j "$$(nproc)" -LE whole_tool

# Rooms that run in threads, under the sanitizer of those: lib/core/threads.cpp says what it cannot see.
# Long searches of one thread take ten minutes a test there: of surface, fit and mechanics only what counts threads is run.
watched := core volume shell wall
threaded := $(watched) surface fit mechanics
tsan: setup
	cd $(root) && cmake --preset tsan && cmake --build --preset tsan --target $(threaded:%=test_%) && \
	  TUNICA_THREADS=4 TSAN_OPTIONS='halt_on_error=1 suppressions=$(abspath $(root))/tests/support/tsan.supp' \
	  ctest --preset tsan -R '^($(subst $() ,|,$(watched)))\.|hreads|^mechanics.DirectSolver'

fuzz: setup
	cd $(root) && cmake --preset fuzz && cmake --build --preset fuzz --target fuzz_harnesses && \
	  /usr/bin/python3 -B tests/fuzz/fuzz.py build/fuzz --seconds $(call quoted,$(or $(SECONDS),60)) \
	  $(if $(PARSER),--parser $(call quoted,$(PARSER)))

package: setup
	cd $(root) && DEB_BUILD_OPTIONS="parallel=$$(nproc) $$DEB_BUILD_OPTIONS" fakeroot debian/rules binary
	cd $(root)debian && rm -rf .debhelper tmp tunica libtunica-dev files *.substvars *.debhelper *.debhelper.log debhelper-build-stamp
	@echo 'package: apt-get install $(root)build/packages/tunica_*.deb'

package-check: setup
	cd $(root) && cmake --preset release && ctest --test-dir build/release -C Package -L package --output-on-failure

site: setup
	cd $(root) && sphinx-build -q -n -W --keep-going -d build/site.trees docs build/site
	@echo 'site: $(root)build/site/index.html'

# The same bytes from the same commit: its time, no user, nothing that is not committed.
tarball:
	@cd $(root) && version=$$(sed -n 's/^project(tunica VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt) && mkdir -p build && \
	  git archive --format=tar --prefix=tunica-$$version/ HEAD > build/tunica.tar && \
	  gzip -n -9 < build/tunica.tar > build/tunica-$$version.tar.gz && rm build/tunica.tar && \
	  echo "tarball: build/tunica-$$version.tar.gz of commit $$(git rev-parse --short HEAD)"

stability:
	cd $(root) && TUNICA_BIN=$(call quoted,$(abspath $(BIN))) PYTHONPATH=tests/support /usr/bin/python3 -B tests/bench/stability.py \
	  $(if $(CELL),--cell $(call quoted,$(CELL)) --keep $(call quoted,$(abspath $(OUT))),$(if $(MAPS),--only $(call quoted,$(MAPS))))

history:
	cd $(root) && TUNICA_BIN=$(call quoted,$(abspath $(BIN))) /usr/bin/python3 -B tests/bench/history.py --instructions \
	  $(if $(HISTORY),--table $(call quoted,$(abspath $(HISTORY)))) $(if $(FACTOR),--factor $(call quoted,$(FACTOR)))

REPORTS ?= $(root)build/charts
CHARTS ?= $(REPORTS)/drawn

charts:
	@cd $(root) && TUNICA_BIN=$(call quoted,$(abspath $(BIN))) PYTHONPATH=tests/support /usr/bin/python3 -B tests/bench/charts.py \
	  $(call quoted,$(abspath $(REPORTS))) $(call quoted,$(abspath $(CHARTS))) $(if $(DATA),--data $(call quoted,$(abspath $(DATA)))) \
	  $(if $(PAPER),--paper $(call quoted,$(abspath $(PAPER))))
	@echo $(call quoted,charts: drawn in $(CHARTS)$(comma) the runs are in $(REPORTS))

# Scenes of docs/scenes.md; each in a folder of OUT of its name.
ifneq ($(and $(DEPOSITS)$(BALLOON),$(filter scene-angioplasty,$(MAKECMDGOALS)),$(if $(VESSEL),,1)),)
  $(error DEPOSITS and BALLOON go with VESSEL)
endif
$(scenes):
	@cd $(root) && /usr/bin/python3 -B examples/scenes/run.py $(@:scene-%=%) $(call quoted,$(abspath $(BIN))) $(call quoted,$(abspath $(OUT))/$@) \
	  $(if $(THREADS),--threads $(call quoted,$(THREADS))) \
	  $(if $(and $(VESSEL),$(filter scene-angioplasty,$@)),--own $(call quoted,$(abspath $(VESSEL) $(DEPOSITS)) $(strip $(BALLOON))))

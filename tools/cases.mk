# The stages of the cases that tools/pipeline.py has planned, run by it in the folder of its plan (described there). No
# name of a file stands here: a case is a folder with a harmless name, and what is run stands quoted in its files.

cases := $(file < cases)

# $(THREADS) stands in RUN, too.
jobs = $(if $(filter -j%,$(MAKEFLAGS)),$(or $(patsubst -j%,%,$(filter -j%,$(MAKEFLAGS))),$(words $(cases))),1)
ifeq ($(THREADS),)
  THREADS := $(shell n=$$(( $$(nproc) / $(jobs) )); echo $$(( n > 1 ? n : 1 )))
endif

.PHONY: all
.SUFFIXES:
all: $(cases:=/simulate.done)

# What each stage leaves beside its report; with ACCURACY simulate leaves refined.ply, too.
files_extract := surface.ply
files_decimate := coarse.ply
files_relax := shell.ply map.png
files_simulate := result.hdf picture.png
from_simulate := simulate
from_relax := relax $(from_simulate)
from_decimate := decimate $(from_relax)
from_extract := extract $(from_decimate)

# $(call stage,case,stage): removes what this stage and the later ones left, notes what this one depends on, runs the
# command where the user stands, and keeps its exit code: none is left by one that was killed. Done is what left its files
# and a good report; looking into the folder first shows what another machine wrote there.
define stage
	@echo '$(1): $(2)' || :
	@: > $(1)/$(2).exit; rm -f $(1)/out/refined.ply $(foreach later,$(from_$(2)),$(addprefix $(1)/out/,$(files_$(later)) \
	  $(later).json $(later).log .$(later).flags)) && cp $(1)/$(2).flags $(1)/out/.$(2).flags
	@( cd "$$TUNICA_FROM" && $(RUN) $(file < $(1)/$(2).command) --threads $(THREADS) ) 2> $(1)/out/$(2).log; code=$$?; \
	  ls $(1)/out/ > /dev/null; \
	  if [ $$code = 0 ] && ! { $(foreach file,$(files_$(2)),[ -s $(1)/out/$(file) ] &&) \
	    grep -q '^  "ok": true' $(1)/out/$(2).json 2> /dev/null; }; then code=1; \
    echo 'tunica-$(2): ended with exit code 0, but without $(files_$(2)) and a good report: look at RUN and at its flags' \
      >> $(1)/out/$(2).log; fi; \
  echo $$code > $(1)/$(2).exit; [ $$code = 0 ] || \
    { cat $(1)/out/$(2).log >&2; rm -f $(addprefix $(1)/out/,$(files_$(2))); exit $$code; }; \
  printf '\n%s' "$$(sha256sum < $(1)/out/$(2).json | cut -c1-64)" >> $(1)/out/.$(2).flags
	@: > $(1)/$(2).done
endef

# $(call rules,case): the chain. No times are compared: a stage is run unless its mark is there, which tools/pipeline.py
# leaves where all that went into the stage, and its files, are what its report says.
define rules
$(addprefix $(1)/,extract.done decimate.done relax.done simulate.done): MEM := $$(file < $(1)/mem)

$(1)/extract.done:
	$$(call stage,$(1),extract)

$(1)/decimate.done: | $(1)/extract.done
	$$(call stage,$(1),decimate)

$(1)/relax.done: | $(1)/decimate.done
	$$(call stage,$(1),relax)

$(1)/simulate.done: | $(1)/relax.done
	$$(call stage,$(1),simulate)
endef
$(foreach case,$(cases),$(eval $(call rules,$(case))))

# cmake -DPAGE=tunica-scene.5 -DSUMMARY=… -DSOURCE=docs/scene.md -DOUT=… -DVERSION=… -DLOWDOWN=… [-DTOOLS=page;page…] -P:
# a page of the documentation as a manual page; with TOOLS also what each of these pages says its tool is.
string(REGEX MATCH "^(.*)[.]([0-9])$" matched ${PAGE})
set(name ${CMAKE_MATCH_1})
set(section ${CMAKE_MATCH_2})
execute_process(COMMAND ${LOWDOWN} -t man --nroff-nolinks --parse-no-intraemph ${SOURCE}
                OUTPUT_VARIABLE text COMMAND_ERROR_IS_FATAL ANY)
string(REGEX REPLACE "^[.]SH\n[^\n]*" ".SH DESCRIPTION" text "${text}")
# Names are not hyphenated; long ones may break.
string(REGEX REPLACE "([a-zA-Z0-9{}][_/]|[a-z0-9]{)([a-zA-Z])" "\\1\\\\:\\2" text "${text}")

# Of four columns the last, which has the sentences, takes the room that there is; equal ones are too narrow for words.
string(REPLACE " expand allbox;\nlb lb lb lb\nl l l l." " allbox;\nlb lb lb lb\nl l l lx." text "${text}")

set(tools "")
foreach(page ${TOOLS})
  file(STRINGS ${page} line REGEX "^tunica[^ ]* .*- ")
  string(REGEX REPLACE "^([^ ]+) [^ ]*- (.*)$" ".TP\n.BR \\1 (1)\n\\2.\n" line "${line}")
  string(APPEND tools "${line}")
endforeach()
if(tools)
  set(tools ".SH TOOLS\n${tools}.PP\nScene files:\n.BR tunica\\-scene (5).\nResults:\n.BR tunica\\-result (5).\n")
endif()

string(TOUPPER ${name} title)
foreach(words title name SUMMARY)
  string(REPLACE "-" "\\-" ${words} "${${words}}")
endforeach()
# No lines stretched to the margin: there is nothing to stretch in the cells of tables.
file(WRITE ${OUT} "'\\\" t
.TH ${title} ${section} \"\" \"tunica ${VERSION}\" \"tunica manual\"
.ad l
.nh
.SH NAME
${name} \\- ${SUMMARY}
${tools}${text}")

# Flags for every target, and the functions that make one.
add_library(tunica_flags INTERFACE)
target_compile_options(tunica_flags INTERFACE -Wall -Wextra -Wpedantic -Wnon-virtual-dtor
                       -Woverloaded-virtual -Wcast-qual -Wformat=2 -Wfloat-conversion)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  target_compile_options(tunica_flags INTERFACE -Wno-restrict)  # false alarms on string + string (GCC bug 105651)
endif()
if(TUNICA_UNITY)
  # A .cpp counts as a header there, and what is local to one is seen by others; the check preset looks at each alone.
  target_compile_options(tunica_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage;-Wshadow=local>)
else()
  target_compile_options(tunica_flags INTERFACE -Wshadow)
endif()
if(TUNICA_WERROR)
  target_compile_options(tunica_flags INTERFACE -Werror)
endif()
# Threads are watched by a sanitizer that goes with no other. With libFuzzer, what is sanitized also tells it which
# branches were taken.
if(TUNICA_SANITIZE STREQUAL "thread")
  set(TUNICA_SANITIZERS thread)
elseif(TUNICA_FUZZ)
  set(TUNICA_SANITIZERS fuzzer-no-link,address,undefined)
else()
  set(TUNICA_SANITIZERS address,undefined)
endif()
# -O1: at -O0 Eigen is so slow that the sanitizer run would need an hour. Where the readers alone are sanitized, their
# tests compute nothing, and -O0 halves the time to compile them.
set(program_level -O1)
if(NOT TUNICA_SANITIZE AND NOT TUNICA_FUZZ)
  set(program_level -O0)
endif()
set(is_program $<STREQUAL:$<TARGET_PROPERTY:TYPE>,EXECUTABLE>)
add_library(tunica_sanitizers INTERFACE)
target_compile_options(tunica_sanitizers INTERFACE $<IF:${is_program},${program_level},-O1> -UNDEBUG
                       -fsanitize=${TUNICA_SANITIZERS}
                       -fno-sanitize-recover=undefined -fno-omit-frame-pointer)
target_link_options(tunica_sanitizers INTERFACE -fsanitize=${TUNICA_SANITIZERS})
if(TUNICA_SANITIZE)
  target_link_libraries(tunica_flags INTERFACE tunica_sanitizers)
endif()

# -DTUNICA_HAS_X86_64_V3=ON: for other machines, whatever this one has.
if(TUNICA_X86_64_V3 AND CMAKE_SYSTEM_PROCESSOR STREQUAL "x86_64")
  include(CheckCXXSourceRuns)
  check_cxx_source_runs("int main() { return __builtin_cpu_supports(\"avx2\") && __builtin_cpu_supports(\"fma\") &&
                                       __builtin_cpu_supports(\"bmi2\") ? 0 : 1; }" TUNICA_HAS_X86_64_V3)
  if(TUNICA_HAS_X86_64_V3)
    # No fused multiply-add: it rounds once where other processors round twice, and one bit makes the greedy searches of
    # decimation and fit take another path.
    set(TUNICA_INSTRUCTIONS -march=x86-64-v3 -mno-fma)
    target_compile_options(tunica_flags INTERFACE ${TUNICA_INSTRUCTIONS}
                           "SHELL:-include ${PROJECT_SOURCE_DIR}/cmake/eigen_packets.hpp")
    target_link_libraries(tunica_flags INTERFACE Eigen3::Eigen)
  endif()
endif()
# False alarms on Eigen's vectors of two numbers.
target_compile_options(tunica_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)

# How Eigen aligns its vectors depends on the instructions, and has to be the same in programs of others: as four doubles
# of std::experimental::simd need it, which are numbers of some of its matrices.
set(TUNICA_ALIGNMENT -DEIGEN_MAX_ALIGN_BYTES=32 -DEIGEN_MAX_STATIC_ALIGN_BYTES=32)
add_library(tunica_alignment INTERFACE)
target_compile_options(tunica_alignment INTERFACE ${TUNICA_ALIGNMENT})

if(TUNICA_SHARED)
  set(CMAKE_POSITION_INDEPENDENT_CODE ON)
  # Calls within the library stay within it: no other definition takes their place, and they are inlined as in a program.
  target_compile_options(tunica_flags INTERFACE -fno-semantic-interposition -fvisibility-inlines-hidden)
  set(CMAKE_INSTALL_RPATH $ORIGIN/../${CMAKE_INSTALL_LIBDIR})
endif()

# Command lines and tests compute nothing themselves, and more takes longer to compile.
set(TUNICA_RECIPE $<$<CONFIG:Release>:-O1>)

# Headers are included as tunica/ROOM/name.hpp, here as where they are installed.
file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/include)
file(CREATE_LINK ${PROJECT_SOURCE_DIR}/lib ${PROJECT_BINARY_DIR}/include/tunica SYMBOLIC)

# tunica_library(NAME LINKS lib... PRIVATE lib...): the .cpp files of lib/NAME and its rooms as the static library tunica_NAME. LINKS are the
# rooms it may include: the link lines are the architecture. SANITIZED: with the tests also tunica_NAME_sanitized, which
# runs under the sanitizers whatever the rest is built with, on those of LINKS that are there as such, too.
function(tunica_library name)
  cmake_parse_arguments(arg "SANITIZED" "" "LINKS;PRIVATE" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cpp)
  add_library(tunica_${name} STATIC ${sources})
  target_include_directories(tunica_${name} PUBLIC
                             $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include>
                             $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include/generated> $<INSTALL_INTERFACE:include>)
  target_link_libraries(tunica_${name} PUBLIC tunica_alignment ${arg_LINKS}
                        PRIVATE $<BUILD_INTERFACE:tunica_flags> ${arg_PRIVATE})
  set_property(GLOBAL APPEND PROPERTY TUNICA_LIBRARIES_WITHIN ${arg_PRIVATE})
  set_target_properties(tunica_${name} PROPERTIES UNITY_BUILD ${TUNICA_UNITY} UNITY_BUILD_BATCH_SIZE 8)
  target_compile_features(tunica_${name} PUBLIC cxx_std_20)
  if(arg_SANITIZED AND TUNICA_TESTS)
    set(links ${arg_LINKS})
    foreach(link ${arg_LINKS})
      if(TARGET ${link}_sanitized)
        list(TRANSFORM links REPLACE "^${link}$" "${link}_sanitized")
      endif()
    endforeach()
    tunica_library(${name}_sanitized LINKS ${links} PRIVATE ${arg_PRIVATE})
    target_link_libraries(tunica_${name}_sanitized PUBLIC tunica_sanitizers)
    set_target_properties(tunica_${name}_sanitized PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
endfunction()

# tunica_test(NAME LINKS lib...): every .cpp of the current folder as one GoogleTest program.
function(tunica_test name)
  cmake_parse_arguments(arg "" "" "LINKS" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cpp)
  add_executable(test_${name} ${sources})
  set_target_properties(test_${name} PROPERTIES UNITY_BUILD ${TUNICA_UNITY} UNITY_BUILD_BATCH_SIZE 8)
  target_link_libraries(test_${name} PRIVATE tunica_flags ${arg_LINKS} GTest::gtest_main GTest::gmock)
  target_compile_options(test_${name} PRIVATE ${TUNICA_RECIPE})
  target_include_directories(test_${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests ${PROJECT_SOURCE_DIR}/tests/lib)
  gtest_discover_tests(test_${name} TEST_PREFIX ${name}. DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 600)
endfunction()

# tunica_tool_test(NAME SCRIPT script.py [ARGUMENTS a...] [TIMEOUT s]): a Python program of the current folder that runs
# the built tools. Python is Debian's own, for make as well: its packages bring NumPy, h5py, NiBabel and VTK.
function(tunica_tool_test name)
  cmake_parse_arguments(arg "" "SCRIPT;TIMEOUT" "ARGUMENTS" TIMEOUT 600 ${ARGN})
  add_test(NAME ${name} COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/${arg_SCRIPT} ${arg_ARGUMENTS})
  set(environment TUNICA_BIN=${PROJECT_BINARY_DIR}/bin TUNICA_BUILD=${PROJECT_BINARY_DIR}
                  TUNICA_SOURCE=${PROJECT_SOURCE_DIR} TUNICA_SHARED_DATA=${TUNICA_SHARED_DATA}
                  PYTHONPATH=${PROJECT_SOURCE_DIR}/tests/support CMAKE=${CMAKE_COMMAND})
  set_tests_properties(${name} PROPERTIES LABELS whole_tool TIMEOUT ${arg_TIMEOUT} ENVIRONMENT "${environment}"
                       ENVIRONMENT_MODIFICATION PATH=path_list_prepend:/usr/bin)
endfunction()

# Debian 12 package names: see setup in Makefile.pipeline.
set(CGAL_DO_NOT_WARN_ABOUT_CMAKE_BUILD_TYPE ON)
set(CGAL_DATA_DIR unused)
find_package(CGAL 5.5 REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)  # CGAL puts its own, older find module first
find_package(HDF5 1.10 REQUIRED COMPONENTS C)
find_package(assimp 5.2 REQUIRED)
find_package(TBB REQUIRED)
find_package(fmt REQUIRED)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(ZLIB REQUIRED)
find_package(PNG REQUIRED)
find_package(TIFF 4.5 REQUIRED)
find_package(OpenSSL REQUIRED COMPONENTS Crypto)
find_package(tomlplusplus REQUIRED)
find_package(EXPAT REQUIRED)
if(TUNICA_TESTS)
  find_package(GTest REQUIRED)
  include(GoogleTest)
endif()

# Both are found by name again where the package is used: no place of this machine is exported.

# CHOLMOD comes without a CMake package.
find_path(CHOLMOD_INCLUDE cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
find_library(CHOLMOD_LIBRARY cholmod REQUIRED)
find_library(SUITESPARSE_CONFIG_LIBRARY suitesparseconfig REQUIRED)
add_library(tunica_cholmod INTERFACE)
target_include_directories(tunica_cholmod SYSTEM INTERFACE $<BUILD_INTERFACE:${CHOLMOD_INCLUDE}>)
target_link_libraries(tunica_cholmod INTERFACE "$<BUILD_INTERFACE:${CHOLMOD_LIBRARY};${SUITESPARSE_CONFIG_LIBRARY}>"
                      "$<INSTALL_INTERFACE:cholmod;suitesparseconfig>")

# cairo comes without a CMake package.
find_package(Freetype REQUIRED)
find_path(CAIRO_INCLUDE cairo-ft.h PATH_SUFFIXES cairo REQUIRED)
find_library(CAIRO_LIBRARY cairo REQUIRED)
add_library(tunica_cairo INTERFACE)
target_include_directories(tunica_cairo SYSTEM INTERFACE "$<BUILD_INTERFACE:${CAIRO_INCLUDE};${FREETYPE_INCLUDE_DIRS}>")
target_link_libraries(tunica_cairo INTERFACE "$<BUILD_INTERFACE:${CAIRO_LIBRARY};${FREETYPE_LIBRARIES}>"
                      "$<INSTALL_INTERFACE:cairo;freetype>")

# OpenCV's CMake package is in libopencv-dev, which pulls in a gigabyte; the two modules used here are enough.
find_path(OPENCV_INCLUDE opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
add_library(tunica_opencv INTERFACE)
target_include_directories(tunica_opencv SYSTEM INTERFACE $<BUILD_INTERFACE:${OPENCV_INCLUDE}>)
foreach(module core imgproc)
  find_library(OPENCV_${module} opencv_${module} REQUIRED)
  target_link_libraries(tunica_opencv INTERFACE $<BUILD_INTERFACE:${OPENCV_${module}}>
                        $<INSTALL_INTERFACE:opencv_${module}>)
endforeach()

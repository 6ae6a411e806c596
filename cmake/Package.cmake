# What find_package(tunica) and pkg-config find: the library as tunica::tunica, and its headers, but for those in detail/.
# Of static rooms each is there as tunica::ROOM, too.
include(CMakePackageConfigHelpers)
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/tunica)
if(TUNICA_SHARED)
  set(TUNICA_FOUND_WITH "")
  set(TUNICA_PC_REQUIRES "")
  set(TUNICA_PC_LIBS -ltunica)
else()
  foreach(room ${TUNICA_ROOMS})
    set_target_properties(tunica_${room} PROPERTIES EXPORT_NAME ${room})
  endforeach()
  set(libraries ${TUNICA_ROOM_LIBRARIES} tunica_cholmod tunica_cairo tunica_opencv)
  file(READ cmake/static_dependencies.cmake.in TUNICA_FOUND_WITH)
  set(TUNICA_PC_REQUIRES hdf5 assimp libpng libtiff-4 zlib libcrypto tbb fmt)
  list(TRANSFORM TUNICA_ROOM_LIBRARIES PREPEND -l OUTPUT_VARIABLE TUNICA_PC_LIBS)
  set(TUNICA_PC_LIBS -Wl,--start-group ${TUNICA_PC_LIBS} -Wl,--end-group -lopencv_imgproc -lopencv_core -lcairo -lfreetype -lexpat -lcholmod
                     -lsuitesparseconfig -lgmp -lmpfr)
endif()
set(TUNICA_PC_CFLAGS ${TUNICA_ALIGNMENT})
foreach(list TUNICA_PC_REQUIRES TUNICA_PC_LIBS TUNICA_PC_CFLAGS)
  list(JOIN ${list} " " ${list})
endforeach()

install(TARGETS tunica tunica_alignment ${libraries} EXPORT tunicaTargets)
install(EXPORT tunicaTargets NAMESPACE tunica:: DESTINATION ${package})
install(DIRECTORY lib/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tunica FILES_MATCHING PATTERN "*.hpp"
        PATTERN detail EXCLUDE PATTERN cli EXCLUDE PATTERN report EXCLUDE)
install(FILES ${PROJECT_BINARY_DIR}/include/generated/tunica/core/version.hpp
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tunica/core)
configure_package_config_file(cmake/tunicaConfig.cmake.in ${PROJECT_BINARY_DIR}/tunicaConfig.cmake
                              INSTALL_DESTINATION ${package})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tunicaConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tunicaConfig.cmake ${PROJECT_BINARY_DIR}/tunicaConfigVersion.cmake
        DESTINATION ${package})
# Its prefix is where it lies, wherever that is moved.
file(RELATIVE_PATH TUNICA_PC_PREFIX /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(cmake/tunica.pc.in ${PROJECT_BINARY_DIR}/tunica.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/tunica.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

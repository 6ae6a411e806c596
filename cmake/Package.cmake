# What find_package(tunica) finds: the libraries as tunica::ROOM, and their headers, but for those in detail/.
include(CMakePackageConfigHelpers)
set(package lib/cmake/tunica)
set(rooms core volume surface shell fit mechanics accuracy draw io)
foreach(room ${rooms})
  list(APPEND libraries tunica_${room})
  set_target_properties(tunica_${room} PROPERTIES EXPORT_NAME ${room})
endforeach()
install(TARGETS ${libraries} tunica_cholmod tunica_cairo tunica_opencv EXPORT tunicaTargets ARCHIVE DESTINATION lib)
install(EXPORT tunicaTargets NAMESPACE tunica:: DESTINATION ${package})
install(DIRECTORY lib/ DESTINATION include/tunica FILES_MATCHING PATTERN "*.hpp" PATTERN detail EXCLUDE
        PATTERN cli EXCLUDE PATTERN report EXCLUDE)
install(FILES ${PROJECT_BINARY_DIR}/include/generated/tunica/core/version.hpp DESTINATION include/tunica/core)
configure_package_config_file(cmake/tunicaConfig.cmake.in ${PROJECT_BINARY_DIR}/tunicaConfig.cmake
                              INSTALL_DESTINATION ${package})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tunicaConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tunicaConfig.cmake ${PROJECT_BINARY_DIR}/tunicaConfigVersion.cmake
        DESTINATION ${package})

# tunica: all rooms but the command line's, for the tools and for programs of others. Static: the rooms as they are.
# TUNICA_SHARED: libtunica, their objects in one shared library, whose own needs stay within it.
list(TRANSFORM TUNICA_ROOMS PREPEND tunica_ OUTPUT_VARIABLE TUNICA_ROOM_LIBRARIES)
if(TUNICA_SHARED)
  list(TRANSFORM TUNICA_ROOM_LIBRARIES REPLACE "(.+)" "$<TARGET_OBJECTS:\\1>" OUTPUT_VARIABLE objects)
  add_library(tunica SHARED ${objects})
  get_property(within GLOBAL PROPERTY TUNICA_LIBRARIES_WITHIN)
  list(REMOVE_DUPLICATES within)
  target_link_libraries(tunica PUBLIC Eigen3::Eigen nlohmann_json::nlohmann_json tunica_alignment
                        PRIVATE ${within} fmt::fmt)
  target_link_options(tunica PRIVATE LINKER:-Bsymbolic-functions,--as-needed,--no-undefined)
  target_include_directories(tunica PUBLIC $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include>
                             $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include/generated>
                             $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(tunica PUBLIC cxx_std_20)
  set_target_properties(tunica PROPERTIES LINKER_LANGUAGE CXX VERSION ${PROJECT_VERSION} SOVERSION 0)
else()
  add_library(tunica INTERFACE)
  target_link_libraries(tunica INTERFACE ${TUNICA_ROOM_LIBRARIES})
endif()

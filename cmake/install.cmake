# What is installed besides the programs (package_program) and the panel (src/panel).

install(TARGETS assembly_cell_cell assembly_cell_core EXPORT assembly_cell_core
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION}
  INCLUDES DESTINATION ${CATKIN_GLOBAL_INCLUDE_DESTINATION})
install(TARGETS assembly_cell_nodelets assembly_cell_ros
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION})

# find_package(assembly_cell_core): the core for plain CMake, without ROS
include(CMakePackageConfigHelpers)
set(generated ${CMAKE_BINARY_DIR}/generated)
set(core_config ${CATKIN_PACKAGE_LIB_DESTINATION}/cmake/assembly_cell_core)
set(core_share ${CATKIN_PACKAGE_SHARE_DESTINATION})
set_target_properties(assembly_cell_cell PROPERTIES EXPORT_NAME cell)
set_target_properties(assembly_cell_core PROPERTIES EXPORT_NAME core)
configure_package_config_file(cmake/assembly_cell_coreConfig.cmake.in ${generated}/assembly_cell_coreConfig.cmake
  INSTALL_DESTINATION ${core_config} PATH_VARS core_share)
write_basic_package_version_file(${generated}/assembly_cell_coreConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(EXPORT assembly_cell_core NAMESPACE assembly_cell:: FILE assembly_cell_coreTargets.cmake DESTINATION ${core_config})
#catkin_lint: ignore missing_file
install(FILES ${generated}/assembly_cell_coreConfig.cmake ${generated}/assembly_cell_coreConfigVersion.cmake DESTINATION ${core_config})

install(DIRECTORY include/${PROJECT_NAME}/ DESTINATION ${CATKIN_PACKAGE_INCLUDE_DESTINATION})
install(DIRECTORY config docs examples launch rviz urdf DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
install(FILES nodelets.xml DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
# the recording that config/sensor_replay.yaml plays
install(DIRECTORY test/data DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION}/test)
# scripts/run and scripts/test build this source tree: they have no place in an installed one
#catkin_lint: ignore uninstalled_script
install(PROGRAMS scripts/faults scripts/free_port scripts/from_bag.py scripts/launch scripts/plot scripts/plot_report.py
  DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
install(DIRECTORY scripts/fault_campaign scripts/plots DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION} FILES_MATCHING PATTERN "*.py")
# beside the tools that call it; the only executable of its name, for rosrun prompts where there are two
configure_file(scripts/from_bag.py ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION}/from_bag.py
  COPYONLY FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

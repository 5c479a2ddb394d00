# What both packages need of ROS 2 from pip.
find_package(ament_cmake REQUIRED)
find_package(action_msgs REQUIRED)
find_package(builtin_interfaces REQUIRED)
find_package(geometry_msgs REQUIRED)
find_package(rosidl_default_generators REQUIRED)

# pip's packages name the Python headers of the machine that built them. The generators find this machine's own.
foreach(package action_msgs builtin_interfaces geometry_msgs service_msgs std_msgs unique_identifier_msgs)
  set(python ${package}::${package}__rosidl_generator_py)
  if(TARGET ${python})
    set_target_properties(${python} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "")
  endif()
endforeach()

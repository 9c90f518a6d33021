# Compiles what type supports have in C++ in a few pieces: most of the time went into reading the same
# headers for each message. The type supports for introspection do not compile that way.
function(cnc_msgs_in_few_pieces)
  foreach(kind typesupport_cpp typesupport_fastrtps_c typesupport_fastrtps_cpp)
    set_target_properties(cnc_msgs__rosidl_${kind} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 25)
  endforeach()
endfunction()
cmake_language(DEFER CALL cnc_msgs_in_few_pieces)

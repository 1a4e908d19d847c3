"""The live ROS 2 node (extra ``ros``): a thin shell around `mapmeld.live`."""

"""Episodes of many legs on a device: actions in, observations, rewards and ends out, by DLPack."""

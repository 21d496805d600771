"""The margin model as it is asked: features, network, calibration, margins and final masses."""

"""Each sample as files of simulators and modelling programs, among its members, if the config asks for it."""

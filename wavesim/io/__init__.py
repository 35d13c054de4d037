"""result.h5, written and read; the only importers of h5py."""

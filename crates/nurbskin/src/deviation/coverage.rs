//! Distance of the surface to the scan: bulges and areas without data.

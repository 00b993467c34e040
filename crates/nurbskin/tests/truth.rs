//! Known surfaces, scanned and fitted.

//! Bodies against their exact surfaces.

//! HTTP: routes, pages, streams, roles. Holds no trial rule.

//! Visibility of one patch from another: the unblocked share of rays between their sub-elements.

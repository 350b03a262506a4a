"""Joint names of other programs: conventions, found by the names of a file or a feed, and our names for them."""

from kinespace.library.naming.convention import Convention, ConventionError, convention_named, conventions, spelling
from kinespace.library.naming.naming import AS_THEY_ARE, AUTO, NamedJoints, Naming, listed, summary, unknown_names

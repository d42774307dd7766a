"""The checker of annotations that pytest applies to lib (see pyproject.toml): beartype, with a whole number allowed
where a float is asked for, as everywhere in Python."""

from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True))

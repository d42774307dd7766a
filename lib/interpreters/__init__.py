"""One package a language, each with the same four verbs: parse, execute, execute_many, sample."""

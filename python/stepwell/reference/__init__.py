"""The NumPy reference: the specification of every number that stepwell computes.

A file here has the name of the file in the Rust core that does the same. Both spell each formula in the same way and in the
same order, so the core equals the reference to the last bit. Read ``steppers/`` as Hoffmann's sections 5 to 12.

Everything is over whole batches: blocks come first, batch axes last, and NumPy's broadcasting does the rest. A system is scaled
to the step: ``dv`` and ``dy`` are Hoffmann's increments h·v̇ and h·ẏ.
"""

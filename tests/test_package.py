"""Facts about the package as a whole: what it exports, and under which names."""

import pkgutil

import ptcc_certify


def test_every_export_is_there_and_stays_what_it_is():
    for name in ptcc_certify.__all__:
        assert getattr(ptcc_certify, name) is getattr(ptcc_certify, name)
        assert getattr(ptcc_certify, name).__doc__ or name == "THEOREMS"
    assert set(ptcc_certify.__all__) <= set(dir(ptcc_certify))


def test_no_module_bears_the_name_of_an_export():
    """Importing such a module would put it in the place of what is exported."""
    modules = {module.name for module in pkgutil.iter_modules(ptcc_certify.__path__)}
    assert {"graphs", "bounds", "simulation"} <= modules
    assert not modules & set(ptcc_certify.__all__)

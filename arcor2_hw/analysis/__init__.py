"""Reads metadata of object types from their source, without importing it."""

from arcor2_hw.analysis.enumerations import Enumeration
from arcor2_hw.analysis.installed import GROUP, InstalledType, installed_types
from arcor2_hw.analysis.library import BUILT_IN, Library
from arcor2_hw.analysis.source import Problem, SourceFile, module_name
from arcor2_hw.analysis.type_analysis import TypeAnalysis

__all__ = [
    "BUILT_IN",
    "GROUP",
    "Enumeration",
    "InstalledType",
    "Library",
    "Problem",
    "SourceFile",
    "TypeAnalysis",
    "installed_types",
    "module_name",
]

"""Tests of testbed/proposal/fits."""

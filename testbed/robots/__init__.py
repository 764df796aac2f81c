"""Robots and the tracker as files, body trees and meshes."""

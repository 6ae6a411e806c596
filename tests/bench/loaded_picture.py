#!/usr/bin/python3
"""A picture of a loaded organ, coloured by the von Mises stress of its wall, from what another program can read.

    tunica-simulate shell.ply result.hdf ... --export pvd
    xvfb-run -a tests/bench/loaded_picture.py result_0001.vtu OUT.png [--title TEXT] [--magnified 1] [--view X,Y,Z] [--up X,Y,Z]

Left the reference, right the loaded shape. The colour bar ends at the value that 1 % of the points pass. Needs Debian's
python3-vtk9 and a display (xvfb).
"""
import argparse

import numpy
import vtk
from vtk.util.numpy_support import vtk_to_numpy


def vector(text):
    return [float(part) for part in text.split(",")]


def actor(grid, lookup, top, warped):
    geometry = vtk.vtkGeometryFilter()
    geometry.SetInputConnection(warped.GetOutputPort()) if warped else geometry.SetInputData(grid)
    normals = vtk.vtkPolyDataNormals()
    normals.SetInputConnection(geometry.GetOutputPort())
    normals.SplittingOff()
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(normals.GetOutputPort())
    if warped:
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray("kilopascal")
        mapper.SetLookupTable(lookup)
        mapper.SetScalarRange(0, top)
    else:
        mapper.ScalarVisibilityOff()
    result = vtk.vtkActor()
    result.SetMapper(mapper)
    result.GetProperty().SetColor(0.82, 0.8, 0.76)
    result.GetProperty().SetAmbient(0.25)
    result.GetProperty().SetDiffuse(0.75)
    return result


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("result")
    parser.add_argument("out")
    parser.add_argument("--title", default="")
    parser.add_argument("--magnified", type=float, default=1)
    parser.add_argument("--view", type=vector, default=[0, -1, 0])
    parser.add_argument("--up", type=vector, default=[0, 0, 1])
    given = parser.parse_args()

    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(given.result)
    reader.Update()
    grid = reader.GetOutput()
    stress = 1000 * vtk_to_numpy(grid.GetPointData().GetArray("von_mises"))
    top = float(numpy.quantile(stress, 0.99))
    values = vtk.vtkDoubleArray()
    values.SetName("kilopascal")
    for value in stress:
        values.InsertNextValue(value)
    grid.GetPointData().AddArray(values)
    grid.GetPointData().SetActiveVectors("displacement")
    warped = vtk.vtkWarpVector()
    warped.SetInputData(grid)
    warped.SetScaleFactor(given.magnified)

    colours = vtk.vtkColorTransferFunction()
    colours.SetColorSpaceToLab()
    for place, colour in ((0, (0.15, 0.25, 0.55)), (0.35, (0.2, 0.6, 0.65)), (0.7, (0.98, 0.85, 0.4)), (1, (0.75, 0.12, 0.15))):
        colours.AddRGBPoint(place * top, *colour)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(1400, 820)
    camera = vtk.vtkCamera()
    for side, (left, right, name) in enumerate(((0, 0.45, "as imaged"), (0.45, 1, "under pressure"))):
        renderer = vtk.vtkRenderer()
        renderer.SetViewport(left, 0, right, 0.92)
        renderer.SetBackground(1, 1, 1)
        renderer.SetActiveCamera(camera)
        renderer.AddActor(actor(grid, colours, top, warped if side else None))
        label = vtk.vtkTextActor()
        label.SetInput(name)
        label.GetTextProperty().SetFontSize(22)
        label.GetTextProperty().SetColor(0.2, 0.2, 0.2)
        label.SetPosition(40, 24)
        renderer.AddViewProp(label)
        if side:
            bar = vtk.vtkScalarBarActor()
            bar.SetLookupTable(colours)
            bar.SetTitle("von Mises stress, kPa\n")
            bar.SetNumberOfLabels(5)
            bar.SetLabelFormat("%.0f")
            bar.UnconstrainedFontSizeOn()
            for text in (bar.GetTitleTextProperty(), bar.GetLabelTextProperty()):
                text.SetColor(0.1, 0.1, 0.1)
                text.SetFontSize(20)
                text.ItalicOff()
                text.BoldOff()
                text.ShadowOff()
            bar.SetPosition(0.80, 0.2)
            bar.SetWidth(0.1)
            bar.SetHeight(0.6)
            renderer.AddViewProp(bar)
        window.AddRenderer(renderer)
        if not side:
            camera.SetPosition(*given.view)
            camera.SetFocalPoint(0, 0, 0)
            camera.SetViewUp(*given.up)
            camera.ParallelProjectionOn()
            renderer.ResetCamera()
            camera.Zoom(1.25)
    # Over both sides, or it would end where the left one does.
    above = vtk.vtkRenderer()
    above.SetViewport(0, 0.92, 1, 1)
    above.SetBackground(1, 1, 1)
    title = vtk.vtkTextActor()
    title.SetInput(given.title)
    title.GetTextProperty().SetFontSize(24)
    title.GetTextProperty().SetColor(0, 0, 0)
    title.SetPosition(40, 18)
    above.AddViewProp(title)
    window.AddRenderer(above)
    window.Render()
    shot = vtk.vtkWindowToImageFilter()
    shot.SetInput(window)
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(given.out)
    writer.SetInputConnection(shot.GetOutputPort())
    writer.Write()


if __name__ == "__main__":
    main()

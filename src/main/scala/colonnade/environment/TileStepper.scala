package colonnade.environment

import chisel3._

/** The march's position: the current interval of the ray in a tile or cell, and the last plane that it was in front of. */
final class TileStepper(m: MarchOperations, planes: PlaneCache, dda: DdaSetup) {
  import m.formats._

  /** Distances along the ray with guard bits where it enters and exits the current tile or cell. */
  val tEnter: UInt = Reg(UInt(distanceBits.W))
  val tExit:  UInt = Reg(UInt(distanceBits.W))

  val isSecondAxis: Bool = Reg(Bool()) // the axis whose tile edge the ray crosses first

  /** The plane's depth at both ends of the interval, and w at its exit. */
  val depthEnter: SInt = Reg(SInt(depthBits.W))
  val depthExit:  SInt = Reg(SInt(depthBits.W))
  val wExit:      SInt = Reg(SInt(depthBits.W))

  val steps:    UInt = Reg(UInt(stepBits.W)) // tiles and cells that the ray has passed
  val isBehind: Bool = Reg(Bool())           // the ray is behind the surfaces that the map shows

  /** The last plane that the ray was in front of, if any. It was seen at the distance `frontDistance`, within 2^frontLog
    * pixels of a corner.
    */
  val hasFront:      Bool       = Reg(Bool())
  val front:         PlaneDepth = Reg(new PlaneDepth(m.formats))
  val frontDistance: UInt       = Reg(UInt(alongBits.W))
  val frontCorner:   MapPixel   = Reg(new MapPixel(layout))
  val frontLog:      UInt       = Reg(UInt(CellResponse.cellLogBits.W))

  val tile: CellResponse = Reg(new CellResponse(layout)) // the planes of the current tile
  val cell: Vec[UInt]    = Reg(Vec(2, UInt(5.W)))        // the current cell of the tile, or 16 or 31 beside it

  /** The interval without guard bits. */
  val enter: UInt = tEnter(distanceBits - 1, guardBits)
  val exit:  UInt = tExit(distanceBits - 1, guardBits)

  val tileExit: UInt = dda.edge(isSecondAxis) // the distance where the ray exits the tile

  /** The tile behind that edge. */
  val nextTile: Seq[UInt] = dda.tile.zipWithIndex.map { case (tile, a) =>
    Mux(isSecondAxis === (a == 1).B, Mux(dda.isNegative(a.U), tile - 1.U, tile + 1.U), tile)
  }

  val tileCorner: MapPixel = CellReader.corner(layout, dda.tile)
  val cellCorner: MapPixel = cornerOf(cell)

  /** The first pixel of a cell of the current tile, or the map's last one. */
  def cornerOf(cell: Seq[UInt]): MapPixel =
    CellReader.pixel(
      layout,
      dda.tile.zip(cell).zip(sizes).map { case ((tile, cell), size) =>
        val pixel = (tile << layout.tileLog) + (cell << this.tile.cellLog)
        Mux(pixel < size.U, pixel, (size - 1).U)
      }
    )

  /** In a step: no plane has been passed yet. */
  def clear(): Unit = {
    m.program.set(isBehind, false.B)
    m.program.set(hasFront, false.B)
    m.program.set(steps, 0.U)
    m.program.set(tEnter, 0.U)
  }

  /** In this cycle a tile or a cell is passed. */
  val isStep: Bool = WireInit(false.B)

  /** In a step: it is passed if the condition holds. */
  def countStep(condition: Bool): Unit = {
    m.program.set(steps, steps + 1.U, condition)
    when(m.program.now && condition)(isStep := true.B)
  }

  /** In a step: the ray is in front of the current plane. */
  def recordFront(condition: Bool): Unit = {
    val isCell = planes.purpose === planes.forCell
    m.program.set(isBehind, false.B, condition)
    m.program.set(hasFront, true.B, condition)
    m.program.set(front, planes.depth, condition)
    m.program.set(frontDistance, Mux(planes.purpose === planes.forFront, exit, enter), condition)
    m.program.set(frontCorner, Mux(isCell, cellCorner, tileCorner), condition)
    m.program.set(frontLog, Mux(isCell, tile.cellLog, layout.tileLog.U), condition)
  }
}

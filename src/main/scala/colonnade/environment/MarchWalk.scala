package colonnade.environment

import chisel3._

/** Where the march is. */
final class MarchWalk(m: MarchDatapath, planes: MarchPlanes, axes: MarchAxes) {
  import m.formats._

  /** From and to, along the ray with guard bits: of a tile or a cell. */
  val begin: UInt = Reg(UInt(wayBits.W))
  val stop:  UInt = Reg(UInt(wayBits.W))

  /** Which axis' edge the ray crosses first. */
  val isSecond: Bool = Reg(Bool())

  /** The depth where the ray enters and leaves, and w where it leaves. */
  val enters: SInt = Reg(SInt(depthBits.W))
  val leaves: SInt = Reg(SInt(depthBits.W))
  val there:  SInt = Reg(SInt(depthBits.W))
  val steps:  UInt = Reg(UInt(stepBits.W))

  /** The ray is behind what the camera sees. */
  val isBehind: Bool = Reg(Bool())

  /** The last plane that it was in front of, if there was one, and where: the pixel at `keptAt`, within 2^keptLog
    * pixels of a corner.
    */
  val hasPlane:   Bool       = Reg(Bool())
  val kept:       PlaneDepth = Reg(new PlaneDepth(m.formats))
  val keptAt:     UInt       = Reg(UInt(alongBits.W))
  val keptCorner: MapPixel   = Reg(new MapPixel(layout))
  val keptLog:    UInt       = Reg(UInt(CellAnswer.cellLogBits.W))

  /** The tile's planes. */
  val tile: CellAnswer = Reg(new CellAnswer(layout))

  /** Of the tile: its cell. */
  val cell: Vec[UInt] = Reg(Vec(2, UInt(4.W)))

  /** Distance along the ray without guard bits. */
  val from: UInt = begin(wayBits - 1, guardBits)
  val to:   UInt = stop(wayBits - 1, guardBits)

  val end: UInt = axes.edge(isSecond)

  val isFront: Bool = !isBehind && enters >= 0.S && leaves >= 0.S

  val tileCorner: MapPixel = corner(axes.tile.map(tile => (tile << layout.tileLog).asUInt))
  val cellCorner: MapPixel =
    corner(axes.tile.zip(cell).zip(sizes).map { case ((tile, cell), size) =>
      val pixel = (tile << layout.tileLog) + (cell << this.tile.cellLog)
      Mux(pixel < size.U, pixel, (size - 1).U)
    })

  /** In a step: the ray is in front of this plane here. */
  def keep(condition: Bool): Unit = {
    val isCell = planes.purpose === planes.forCell
    m.program.set(isBehind, false.B, condition)
    m.program.set(hasPlane, true.B, condition)
    m.program.set(kept, planes.depth, condition)
    m.program.set(keptAt, Mux(planes.purpose === planes.forKeeping, to, from), condition)
    m.program.set(keptCorner, Mux(isCell, cellCorner, tileCorner), condition)
    m.program.set(keptLog, Mux(isCell, tile.cellLog, layout.tileLog.U), condition)
  }

  private def corner(place: Seq[UInt]): MapPixel = {
    val pixel = Wire(new MapPixel(layout))
    pixel.x := place(0)
    pixel.y := place(1)
    pixel
  }
}

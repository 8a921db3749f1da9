package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, Pipe, Queue, RegEnable, Valid}
import colonnade.config.{ColonnadeConfig, TileGrid}
import colonnade.formats.Load

/** A pixel with sideband data. */
final class TaggedPixel[T <: Data](layout: TileGrid, private val extra: T) extends Bundle {
  val pixel    = new MapPixel(layout)
  val sideband = extra.cloneType
}

/** A tile's descriptor and the pixel's position in the tile. */
final class PixelInTile[D <: Data, T <: Data](layout: TileGrid, private val kind: D, private val extra: T)
    extends Bundle {
  val descriptor = kind.cloneType
  val x          = UInt(layout.tileLog.W)
  val y          = UInt(layout.tileLog.W)
  val sideband   = extra.cloneType

  /** Index of the pixel's cell, row by row, where a tile has 2^log cells along each edge. */
  def cell(log: Int): UInt = Cat(Seq(y, x).map(position => position(position.getWidth - 1, position.getWidth - log)))
}

/** Ports of [[TileLookup]]; D is the descriptor, T the sideband data. */
final class TileLookupIO[D <: Data, T <: Data](config: ColonnadeConfig, layout: TileGrid, descriptor: D, sideband: T)
    extends Bundle {
  val load  = Flipped(Valid(new Load(config)))
  val pixel = Flipped(Decoupled(new TaggedPixel(layout, sideband)))
  val tile  = Decoupled(new PixelInTile(layout, descriptor, sideband))
}

/** Looks up the descriptor of a pixel's tile. Latency three cycles, one pixel a cycle, in order. A pixel is accepted
  * only if there is space for its tile in the output queue, so a stalled output never loses one.
  *
  * @param memory name of the descriptors' memory
  */
final class TileLookup[D <: Data, T <: Data](
    config:     ColonnadeConfig,
    layout:     TileGrid,
    memory:     String,
    descriptor: D,
    sideband:   T
) extends Module {
  val io = IO(new TileLookupIO(config, layout, descriptor, sideband))

  private val descriptors = AttributeStore(config, memory, io.load)
  private val pixel       = io.pixel.bits.pixel
  private val found       = Wire(Decoupled(chiselTypeOf(io.tile.bits)))

  // Accept pixels while the output queue has space
  private val queueDepth = TileLookup.latency + 1
  private val inFlight   = RegInit(0.U(log2Ceil(queueDepth + 1).W))
  inFlight       := inFlight + io.pixel.fire - io.tile.fire
  io.pixel.ready := inFlight =/= queueDepth.U
  assert(!io.pixel.fire || (pixel.x < layout.mapWidth.U && pixel.y < layout.mapHeight.U), "a pixel outside the map")

  // Read its tile's descriptor
  private val tile    = (pixel.y >> layout.tileLog) * layout.tileColumns.U + (pixel.x >> layout.tileLog)
  private val request = Pipe(io.pixel.fire, io.pixel.bits)
  descriptors.read.valid := request.valid
  descriptors.read.bits  := RegEnable(tile(layout.tileBits - 1, 0), io.pixel.fire)

  // Queue it
  private val read = Pipe(request)
  found.valid           := read.valid
  found.bits.descriptor := descriptors.word.asTypeOf(descriptor)
  found.bits.x          := read.bits.pixel.x
  found.bits.y          := read.bits.pixel.y
  found.bits.sideband   := read.bits.sideband
  assert(!read.valid || found.ready, "a tile without space")
  io.tile <> Queue(found, queueDepth)
}

object TileLookup {
  val latency: Int = 3
}

/** The march's position: the current interval of the ray in a tile or cell, and the last plane that it was in front of.
  */
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

  /** The last plane that the ray was in front of, if any. It was seen at the distance `frontDistance`, within
    * 2^frontLog pixels of a corner.
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

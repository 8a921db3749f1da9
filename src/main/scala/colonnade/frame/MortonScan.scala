package colonnade.frame

import chisel3._
import chisel3.util.{Cat, Decoupled}

/** Cells of a grid in each direction, up to 2^levels. */
final class GridSize(levels: Int) extends Bundle {
  val wide = UInt((levels + 1).W)
  val high = UInt((levels + 1).W)
}

final class GridCell(levels: Int) extends Bundle {
  val x = UInt(levels.W)
  val y = UInt(levels.W)
}

final class MortonScanIO(levels: Int) extends Bundle {
  val size   = Flipped(Decoupled(new GridSize(levels)))
  val cells  = Decoupled(new GridCell(levels))
  val isIdle = Output(Bool()) // no cell is left
}

/** Scans the cells of a grid in Morton order, so that consecutive cells are close to each other.
  *
  * Throughput: one cell per cycle, the first one in the cycle after the grid is accepted. The next grid is accepted with
  * the last step of the current one. Codes outside the grid are skipped in whole blocks, at most three per level between
  * two cells. An empty grid gives no cell.
  */
final class MortonScan(levels: Int) extends Module {
  val io = IO(new MortonScanIO(levels))

  private val isBusy = RegInit(false.B)
  private val size   = Reg(new GridSize(levels))
  private val code   = Reg(UInt((2 * levels).W))

  private val cell = Wire(new GridCell(levels))
  cell.x := Cat((0 until levels).reverse.map(level => code(2 * level)))
  cell.y := Cat((0 until levels).reverse.map(level => code(2 * level + 1)))
  private val isInside = cell.x < size.wide && cell.y < size.high

  // A block whose first cell is outside is wholly outside: skip the largest block that starts here.
  private val digits = Cat((0 until levels).reverse.map(level => code(2 * level + 1, 2 * level).orR))
  private val lowest = digits & (0.U - digits)
  private val block  = Cat((0 until levels).reverse.map(level => Cat(0.U(1.W), lowest(level))))
  private val next   = code +& Mux(isInside, 1.U, block)

  private val isLast = next(2 * levels) || (!isInside && !digits.orR)
  private val steps  = isBusy && (!isInside || io.cells.ready)

  io.cells.valid := isBusy && isInside
  io.cells.bits  := cell
  io.size.ready  := !isBusy || (steps && isLast)
  io.isIdle      := !isBusy

  when(io.size.fire) {
    isBusy := true.B
    size   := io.size.bits
    code   := 0.U
  }.elsewhen(steps) {
    isBusy := !isLast
    code   := next
  }
}

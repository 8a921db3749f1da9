package colonnade.refit

import chisel3._
import chisel3.util._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{NodeRecord, RecordFormats}

/** Writes nodes from the boxes of their children. The exponent of an axis is the least with which all planes fit: by
  * the bit length, or one more.
  */
final class NodeBuilder(config: ColonnadeConfig) extends Module {
  val root    = IO(Input(UInt(RecordFormats.addressBits(config).W))) // address of the record 0
  val nodes   = IO(Flipped(Decoupled(new RefitNode(config))))
  val records = IO(Decoupled(new RefitRecord(config)))
  val isIdle  = IO(Output(Bool()))

  private val vertexBits = config.geometry.vertexBits
  private val boxBits    = config.geometry.boxBits
  private val node       = Reg(new RefitNode(config))
  private val record     = Reg(new NodeRecord(config))
  private val address    = Reg(chiselTypeOf(records.bits.address))
  private val count      = node.entry.children

  // Steps: exponent, shift, correction, and the planes of a child each, a cycle after they are shifted. The next node
  // begins while the record waits, and is not corrected before it has left
  private val isBusy   = RegInit(false.B)
  private val step     = Reg(UInt(3.W))
  private val first    = 3
  private val isDone   = RegInit(false.B)
  private val corrects = isBusy && step === (first - 1).U && !isDone
  private val waits    = step === (first - 1).U && isDone
  private val isLast   = step === count +& first.U
  isIdle        := !isBusy && !isDone
  records.valid := isDone
  nodes.ready   := !isBusy || isLast
  when(records.fire) { isDone := false.B }
  when(isBusy && !waits) {
    step := step + 1.U
    when(isLast) {
      isBusy := false.B
      isDone := true.B
    }
  }
  when(nodes.fire) {
    isBusy := true.B
    step   := 0.U
    node   := nodes.bits
  }

  private val child   = (step - first.U)(1, 0)
  private val isChild = step >= first.U
  private val shifted = Mux(isChild, node.boxes(child), node.all)
  private val last    = (step - (first + 1).U)(1, 0) // the child that was shifted in the step before
  private val most    = (1 << boxBits) - 1

  for (axis <- 0 until 3) {
    val extent   = Reg(SInt((vertexBits + 1).W)) // less 1
    val exponent = Reg(UInt(RecordFormats.exponentBits(config).W))
    val low      = Reg(UInt(vertexBits.W))
    val below    = Reg(SInt((vertexBits + 1).W)) // the high plane less 1
    val origin   = Reg(UInt(vertexBits.W))
    when(nodes.fire) { extent := nodes.bits.all.below.axes(axis) - nodes.bits.all.low.axes(axis).zext }

    // One-hot by the highest bit of the extent from `boxBits` on: each has its exponent
    val highest = Reverse(PriorityEncoderOH(Reverse(extent(vertexBits - 1, boxBits))))
    val span    = below - low.zext
    val isLarge = span >= most.S
    val exact   = exponent + isLarge
    when(isBusy && step === 0.U) {
      exponent := Mux(extent < 0.S, 0.U, Mux1H(highest, Seq.tabulate(vertexBits - boxBits)(i => (i + 1).U)))
    }
    low   := shifted.low.axes(axis) >> exponent
    below := shifted.below.axes(axis) >> exponent
    when(corrects) {
      val mask = UIntToOH(exact, vertexBits + 1) // the marker
      exponent                 := exact
      origin                   := low >> isLarge
      record.corner.axes(axis) := (node.all.low.axes(axis) ## 0.U(1.W)) & ~(mask | (mask - 1.U)) | mask
      record.children.foreach { box =>
        box.low.axes(axis)  := 0.U
        box.high.axes(axis) := 0.U
      }
    }
    when(isBusy && step > first.U) {
      record.children(last).low.axes(axis)  := low - origin
      record.children(last).high.axes(axis) := (below.asUInt - origin) + 1.U
    }
  }
  when(corrects) {
    address       := node.entry.address
    record.first  := root + node.entry.first
    record.leaves := node.entry.leaves
    record.nodes  := node.entry.nodes
  }
  records.bits.address := address
  records.bits.record  := record.asUInt
}

package colonnade.refit

import chisel3._
import chisel3.util._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{NodeRecord, Vec3}

/** A node with the boxes of its children, and their bounds. */
final class RefitNode(config: ColonnadeConfig) extends Bundle {
  val entry = new RefitEntry(config)
  val boxes = Vec(NodeRecord.most, new RefitBox(config))
  val all   = new RefitBox(config)
}

final class BoxStackIO(config: ColonnadeConfig) extends Bundle {
  val clear   = Input(Bool())
  val items   = Flipped(Decoupled(new RefitItem(config)))
  val leaves  = Decoupled(new RefitRecord(config))
  val nodes   = Decoupled(new RefitNode(config))
  val isIdle  = Output(Bool())
  val isError = Output(Bool()) // a pulse: a node has no children, or they are not there; or too many boxes wait
}

/** Holds the boxes of what has been built until their node comes, whose children are the last ones. */
final class BoxStack(config: ColonnadeConfig) extends Module {
  val io = IO(new BoxStackIO(config))

  private val memory = SyncReadMem(RefitPlan.boxes, UInt((new RefitBox(config)).getWidth.W))
  private val depth  = RegInit(0.U(log2Ceil(RefitPlan.boxes + 1).W))
  private val item   = io.items.bits

  // Boxes go in a cycle after their item: no node reads earlier
  private val box    = Reg(new RefitBox(config))
  private val pushes = RegInit(false.B)
  private val slot   = Reg(UInt(log2Ceil(RefitPlan.boxes).W))
  when(pushes) { memory.write(slot, box.asUInt) }
  pushes := false.B

  // A node gathers its children from the last to the first
  private object State extends ChiselEnum { val idle, gather, leave = Value }
  private val state   = RegInit(State.idle)
  private val node    = Reg(new RefitNode(config))
  private val left    = Reg(UInt(NodeRecord.countBits.W)) // children that have not been read
  private val reads   = state === State.gather && left =/= 0.U
  private val isRead  = RegNext(reads, false.B)
  private val index   = RegNext(left - 1.U)
  private val isFirst = RegNext(state === State.gather && left === node.entry.children)
  private val child   = memory.read((depth - 1.U)(slot.getWidth - 1, 0)).asTypeOf(box)
  when(isRead) {
    node.boxes(index(1, 0)) := child
    node.all                := Mux(isFirst, child, node.all.widened(child))
  }

  private val isFull   = depth === RefitPlan.boxes.U
  private val children = item.entry.children
  private val isNode   = item.isNode && children =/= 0.U && children <= NodeRecord.most.U && children <= depth
  private val isLeaf   = !item.isNode && !isFull
  private val pushed   = WireInit(0.U.asTypeOf(box))
  io.items.ready         := state === State.idle && (item.isNode || io.leaves.ready)
  io.leaves.valid        := state === State.idle && io.items.valid && !item.isNode
  io.leaves.bits.address := item.entry.address
  io.leaves.bits.record  := item.record
  io.isError             := io.items.fire && !isNode && !isLeaf
  private def push(value: RefitBox, to: UInt): Unit = {
    box    := value
    slot   := to
    pushes := true.B
    depth  := to + 1.U
  }
  pushed.low   := item.low
  pushed.below := Vec3.of(item.high.axes.map(_.zext - 1.S))

  switch(state) {
    is(State.idle) {
      node.entry := item.entry
      left       := children
      when(io.items.fire && isLeaf) { push(pushed, depth) }
      when(io.items.fire && isNode) { state := State.gather }
    }
    is(State.gather) {
      when(reads) {
        left  := left - 1.U
        depth := depth - 1.U
      }.otherwise { state := State.leave }
    }
    is(State.leave) {
      when(io.nodes.ready) {
        push(node.all, depth)
        state := State.idle
      }
    }
  }
  when(io.clear) { depth := 0.U }
  io.nodes.valid := state === State.leave
  io.nodes.bits  := node
  io.isIdle      := state === State.idle
}

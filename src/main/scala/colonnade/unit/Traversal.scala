package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Queue, Valid}
import colonnade.common.Context
import colonnade.config.TraversalConfig
import colonnade.formats.{NodeRecord, SceneMap}
import colonnade.ray.PreparedRay
import colonnade.traversal.{BoxUnit, LinearScan, NodeRef, TMaxReader, TraversalStack, TraversalStep}

final class TraversalIO(config: TraversalConfig) extends Bundle {
  val clear = Input(Bool()) // resets `deepest`
  val scene = Input(new SceneMap(config.device))

  /** A ray enters the object's box; its first record is [[Traversal.root]]. */
  val start = Flipped(Valid(Context(config)))
  val nodes = Flipped(Decoupled(new NodeCandidate(config)))

  /** `nodes` is ready in the next cycle; contexts that have finished a triangle record. */
  val readyNext = Output(Bool())
  val resume    = Flipped(Decoupled(Context(config)))

  /** Of the context of `nodes`, and of that whose stack is used. */
  val tMax  = Vec(2, new TMaxReader(config))
  val steps = Decoupled(new TraversalStep(config))

  /** For the counters. */
  val boxTests = Output(UInt(log2Ceil(NodeRecord.most + 1).W))
  val busy     = Output(Bool())
  val deepest  = Output(UInt(log2Ceil(config.device.columnBvhMemory.stackDepth + 1).W))
  val overflow = Output(Bool())

  val illegal = Output(Bool()) // a node was illegal and treated as empty
}

/** Decides which record each ray visits next: BoxUnit and TraversalStack, or LinearScan without a BVH. */
final class Traversal(config: TraversalConfig) extends Module {
  val io             = IO(new TraversalIO(config))
  private val resume = Queue(io.resume, config.contexts) // contexts are tokens, so this queue never overflows

  if (config.device.geometry.bvh) {
    val boxUnit = Module(new BoxUnit(config))
    val stack   = Module(new TraversalStack(config))
    val isLegal = io.nodes.bits.node.isLegal(io.nodes.bits.address)

    boxUnit.io.scene           := io.scene
    boxUnit.io.in.valid        := io.nodes.valid
    boxUnit.io.in.bits.context := io.nodes.bits.context
    boxUnit.io.in.bits.node    := io.nodes.bits.node
    when(!isLegal) {
      boxUnit.io.in.bits.node.nodes  := 0.U
      boxUnit.io.in.bits.node.leaves := 0.U
    }
    boxUnit.io.in.bits.ray  := io.nodes.bits.ray
    boxUnit.io.in.bits.tMax := io.tMax(0).units
    io.tMax(0).context      := io.nodes.bits.context
    io.nodes.ready          := boxUnit.io.in.ready
    io.readyNext            := boxUnit.io.readyNext

    stack.io.clear := io.clear
    stack.io.start := io.start
    stack.io.results :<>= boxUnit.io.out
    stack.io.resume :<>= resume
    io.tMax(1) :<>= stack.io.tMax
    io.steps :<>= stack.io.steps

    io.boxTests := Mux(boxUnit.io.out.fire, boxUnit.io.out.bits.tests, 0.U)
    io.busy     := boxUnit.io.busy
    io.deepest  := stack.io.deepest
    io.overflow := stack.io.overflow
    io.illegal  := io.nodes.fire && !isLegal
  } else {
    val scan = Module(new LinearScan(config))
    scan.io.scene := io.scene
    scan.io.start := io.start
    scan.io.resume :<>= resume
    io.steps :<>= scan.io.steps

    io.tMax.foreach(_.context := 0.U)
    io.nodes.ready := true.B
    io.readyNext   := true.B
    io.boxTests    := 0.U
    io.busy        := false.B
    io.deepest     := 0.U
    io.overflow    := false.B
    io.illegal     := false.B
  }
}

object Traversal {

  /** The first record of a ray: the root node of the scene or of its object, or without a BVH the first leaf. */
  def root(config: TraversalConfig, ray: PreparedRay, scene: SceneMap): NodeRef = {
    val root = Wire(new NodeRef(config))
    root.isLeaf  := (!config.device.geometry.bvh).B
    root.address := (if (config.device.geometry.bvh) ray.root.getOrElse(scene.root) else 0.U)
    root
  }
}

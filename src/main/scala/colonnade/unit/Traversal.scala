package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Queue, Valid}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig
import colonnade.formats.{ChildKind, RecordFormats, SceneMap}
import colonnade.numbers.Fixed
import colonnade.ray.{BoxRay, RayFormats}
import colonnade.traversal.{BoxUnit, LinearScan, NodeRef, TraversalStack, TraversalStep}

/** Which record each ray visits next: BoxUnit and TraversalStack, or without a BVH the exhaustive walk. */
final class Traversal(config: ColonnadeConfig) extends Module {
  private val contexts = config.array.contexts

  val io = IO(new Bundle {
    val clear = Input(Bool())
    val scene = Input(new SceneMap(RecordFormats.idBits(config)))

    /** A ray enters the object's box; its first visit is [[Traversal.root]]. */
    val start = Flipped(Valid(Context(config)))

    /** A node for a context. */
    val nodes = Flipped(Decoupled(new FetchResponse(config)))

    /** `nodes` will be ready in the next cycle. */
    val readyNext = Output(Bool())

    /** The ray of `nodes.bits.context`. */
    val ray = Input(new BoxRay(config.numbers))

    /** Contexts that are through with a triangles record. */
    val resume    = Flipped(Decoupled(Context(config)))
    val tMaxUnits = Input(Vec(contexts, new Fixed(new RayFormats(config.numbers).units)))
    val steps     = Decoupled(new TraversalStep(config))

    /** For the counters. */
    val boxTests = Output(UInt(log2Ceil(config.geometry.arity + 1).W))
    val busy     = Output(Bool())
    val deepest  = Output(UInt(log2Ceil(config.columnBvhMemory.stackDepth + 1).W))
    val overflow = Output(Bool())

    /** A node was illegal and counted as empty. */
    val illegal = Output(Bool())
  })

  /** Contexts are tokens: a queue of as many places never fills. */
  private val resume = Queue(io.resume, contexts)

  if (config.geometry.bvh) {
    val boxUnit = Module(new BoxUnit(config))
    val stack   = Module(new TraversalStack(config))
    val node    = new RecordFormats(config).asNode(io.nodes.bits.record)
    val isLegal = node.isLegal(io.nodes.bits.address)

    boxUnit.io.in.valid        := io.nodes.valid
    boxUnit.io.in.bits.context := io.nodes.bits.context
    boxUnit.io.in.bits.node    := node
    when(!isLegal)(boxUnit.io.in.bits.node.kinds.foreach(_ := ChildKind.empty))
    boxUnit.io.in.bits.ray  := io.ray
    boxUnit.io.in.bits.tMax := io.tMaxUnits(io.nodes.bits.context)
    io.nodes.ready          := boxUnit.io.in.ready
    io.readyNext            := boxUnit.io.readyNext

    stack.io.clear := io.clear
    stack.io.start := io.start
    stack.io.results :<>= boxUnit.io.out
    stack.io.resume :<>= resume
    stack.io.tMaxUnits := io.tMaxUnits
    io.steps :<>= stack.io.steps

    io.boxTests := Mux(boxUnit.io.out.fire, boxUnit.io.out.bits.tests, 0.U)
    io.busy     := boxUnit.io.busy
    io.deepest  := stack.io.deepest
    io.overflow := stack.io.overflow
    io.illegal  := io.nodes.fire && !isLegal
  } else {
    val walk = Module(new LinearScan(config))
    walk.io.scene := io.scene
    walk.io.start := io.start
    walk.io.resume :<>= resume
    io.steps :<>= walk.io.steps

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

  /** Where every ray begins: the root, or without a BVH the first triangles record. */
  def root(config: ColonnadeConfig, scene: SceneMap): NodeRef = {
    val target = Wire(new NodeRef(config))
    target.isLeaf  := (!config.geometry.bvh).B
    target.address := (if (config.geometry.bvh) 0.U else scene.triangleBase)
    target
  }
}

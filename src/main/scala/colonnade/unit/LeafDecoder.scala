package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Queue, Valid}
import colonnade.common.{Context, ModuloSchedule, ReservedQueue}
import colonnade.common.ModuloSchedule.{interval, xyz}
import colonnade.config.PathConfig
import colonnade.formats.{Face, InstanceNumber, Leaf, LeafRecord, Vec3}
import colonnade.numbers.Fixed
import colonnade.shading.{GeometricNormalStage, OctahedralDecoder}

/** The leaf of a hit. */
final class HitLeaf(config: PathConfig) extends Bundle {
  val context  = Context(config)
  val isSecond = Bool() // the hit is on the leaf's second triangle
  val record   = UInt(LeafRecord.recordBits(config.device.geometry).W)
  val instance = InstanceNumber(config.device)
}

/** The attributes of a hit; as in [[colonnade.formats.Face]], without colours. */
final class HitFace(config: PathConfig) extends Bundle {
  private val face = new Face(config.device)

  val context         = Context(config)
  val normals         = face.normals.cloneType
  val geometricNormal = face.geometricNormal.cloneType
  val material        = face.material.cloneType
  val instance        = InstanceNumber(config.device)
}

final class LeafDecoderIO(config: PathConfig) extends Bundle {
  val leaf      = Flipped(Valid(new HitLeaf(config)))
  val readyNext = Output(Bool()) // a leaf is accepted in the next cycle

  /** A face is accepted in the next cycle; the context that gets its face then. */
  val mayTakeNext = Input(Bool())
  val grantNext   = Output(Valid(Context(config)))
  val face        = Output(Valid(new HitFace(config)))
}

/** Finds the attributes of hits in leaves: a leaf every three cycles, and faces in the order of leaves, as the shader
  * is ready. {{{ leaf ─▶ vertices ─▶ GeometricNormalStage ─┬▶ queue ─▶ face           └─ codes ─▶ OctahedralDecoder ──┘
  * }}} The stages never stall: a leaf enters only if the queue has a free entry.
  */
final class LeafDecoder(config: PathConfig) extends Module {
  import LeafDecoder._

  val io = IO(new LeafDecoderIO(config))

  private val phase    = RegInit(0.U.asTypeOf(ModuloSchedule.phase()))
  private val schedule = new ModuloSchedule(phase)
  import schedule._
  phase := Mux(isAt(interval - 1), 0.U, phase + 1.U)

  // The entry. A leaf has an entry of the queue from then on until its face leaves
  private val used  = RegInit(0.U(log2Ceil(queueDepth + 1).W))
  private val hit   = latch(entry)(io.leaf.bits)
  private val valid = latchFlag(entry)(io.leaf.valid)
  used         := used + io.leaf.valid - io.face.valid
  io.readyNext := isAt(entry - 1) && used =/= queueDepth.U
  assert(!io.leaf.valid || isAt(entry), "a leaf comes when none is accepted")

  // Its triangle
  private val now      = hit.at(xyz(entry + 1))
  private val leaf     = new Leaf(config.device.geometry, now.record)
  private val vertices = Leaf.corners.map { case (second, first) => Mux(now.isSecond, second.U(2.W), first.U(2.W)) }

  private val geometric = Module(new GeometricNormalStage(config.device.geometry)).io
  geometric.phase    := phase
  geometric.vertices := VecInit(vertices.map(leaf.vertex))

  // Codes wait, so that their normals come with the components of the geometric normal
  private val corner = Module(new OctahedralDecoder).io
  private val codes  = arriving(select(xyz(entry + 1))(i => leaf.normal(vertices(i))), xyz(entry + 1))
  corner.code := delay(codes, xyz(entry + 1), decode - entry - 1).at(xyz(decode))

  private def collected[T <: Data](value: T): Seq[T] =
    normals.init.map(cycle => latch(cycle)(value).at(normals.last)) :+ value
  private def carried[T <: Data](value: T): T = carry(latch(entry + 1)(value), normals.last).at(normals.last)
  private val normal                          = collected(geometric.normal)
  private val isFlat                          = carried(leaf.isFlat)
  private val out                             = Wire(new HitFace(config))
  out.context := carried(now.context)
  out.material := carried(leaf.material)
  out.instance.zip(now.instance).foreach { case (to, from) => to := carried(from) }
  connect(out.geometricNormal, normal)
  for ((to, from) <- out.normals.zip(collected(corner.normal)))
    connect(to, from.axes.zip(normal).map { case (smooth, flat) => Mux(isFlat, flat, smooth) })

  // Faces, and their contexts one cycle before
  private val faces    = Module(new ReservedQueue(new HitFace(config), queueDepth)).io
  private val contexts = Module(new Queue(Context(config), queueDepth)).io
  faces.in.valid     := isAt(normals.last) && carryFlag(valid, normals.last).at(normals.last)
  faces.in.bits      := out
  faces.mayTakeNext  := io.mayTakeNext
  faces.out.ready    := true.B
  contexts.enq.valid := io.leaf.valid
  contexts.enq.bits  := io.leaf.bits.context
  contexts.deq.ready := io.grantNext.valid
  io.grantNext.valid := faces.validNext && io.mayTakeNext
  io.grantNext.bits  := contexts.deq.bits
  io.face.valid      := faces.out.valid
  io.face.bits       := faces.out.bits

  private def connect(to: Vec3[Fixed], from: Seq[SInt]): Unit =
    to.axes.zip(from).foreach { case (component, value) => component := Fixed(component.format, value) }
}

object LeafDecoder {

  /** A leaf comes in this cycle, and its normals in these. */
  private val entry   = 2
  private val normals = xyz(entry + 1 + GeometricNormalStage.normal0)
  private val decode  = normals.head - OctahedralDecoder.latency

  /** Leaves from the entry to the end of the queue, so that one enters every three cycles. */
  private val queueDepth = (normals.last - entry) / interval + 2
}
